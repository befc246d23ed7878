#include "autograd/ops/losses.h"

#include <algorithm>

#include "autograd/kernels/losses.h"
#include "autograd/ops/elementwise.h"

namespace supertac {

// x, target of any shape [...];  value [] = mean over the n elements of (x - target)^2
// gx = 2 gy (x - target) / n,  gtarget = -gx
Variable l2_loss(const Variable& x, const Variable& target) {
  check_same_shape("l2_loss", "x", x, "target", target);
  const Dim n = x.size();
  if (n == 0) refuse("l2_loss", "x", "an element or more", x.shape().text());
  const double total = kernels::squared_error(n, x.value().data(), target.value().data());
  const auto value = static_cast<real>(total / static_cast<double>(n));
  return record("l2_loss", Tensor::full({}, value), {&x, &target}, [n](Backward& g) {
    const real twice_each = 2 * g.gy().item() / static_cast<real>(n);
    const Slot gx = g.slot_of(0), gtarget = g.slot_of(1);
    kernels::squared_error_grad(n, twice_each, g.value(0).data(), g.value(1).data(), gx, gtarget);
  });
}

// x, target [N,H,W,1];  value = mean over images and positions of SSIM
// gx = gy d value / dx; the target is a constant
Variable ssim(const Variable& x, const Tensor& target) {
  check_rank("ssim", "x", x, 4);
  if (target.shape() != x.shape()) refuse("ssim", "target", x.shape().text(), target.text());
  if (x.dim(0) < 1 || x.dim(3) != 1 || std::min(x.dim(1), x.dim(2)) < 3)
    refuse("ssim", "x", "[N,H,W,1] with N >= 1 and H, W >= 3", x.shape().text());
  const Dim images = x.dim(0), height = x.dim(1), width = x.dim(2);
  const double total = kernels::ssim(images, height, width, x.value().data(), target.data());
  const auto value = static_cast<real>(total / static_cast<double>(images));
  const auto reverse = [=](Backward& g) {
    const real each_image = g.gy().item() / static_cast<real>(images);
    kernels::ssim_grad(images, height, width, each_image, g.value(0).data(), target.data(), g.slot_of(0));
  };
  const OpSettings settings{.constant = target};
  return record("ssim", Tensor::full({}, value), {&x}, reverse, &settings);
}

// logits [N,K];  value = mean over n of -log softmax(logits[n])[label n]
// glogits[n,k] = gy (softmax(logits[n])[k] - [k = label n]) / N
Variable softmax_cross_entropy(const Variable& logits, std::span<const std::int32_t> labels) {
  check_rank("softmax_cross_entropy", "logits", logits, 2);
  const Dim rows = logits.dim(0), classes = logits.dim(1);
  if (rows == 0) refuse("softmax_cross_entropy", "logits", "a row or more", logits.shape().text());
  if (static_cast<Dim>(labels.size()) != rows)
    refuse("softmax_cross_entropy", "labels", std::to_string(rows) + " entries",
           std::to_string(labels.size()));
  Tensor gradient(logits.shape());  // softmax - one-hot, kept for the reverse step
  double total = 0;
  for (Dim n = 0; n < rows; ++n) {
    const Dim label = labels[static_cast<std::size_t>(n)];
    if (label < 0 || label >= classes)
      refuse("softmax_cross_entropy", "labels[" + std::to_string(n) + "]",
             "a class in [0," + std::to_string(classes) + ")", std::to_string(label));
    total += kernels::cross_entropy(classes, logits.value().data() + n * classes, label,
                                    gradient.data() + n * classes);
  }
  const auto value = static_cast<real>(total / static_cast<double>(rows));
  return record("softmax_cross_entropy", Tensor::full({}, value), {&logits}, [gradient, rows](Backward& g) {
    const real each_row = g.gy().item() / static_cast<real>(rows);
    add_to_gradient(g, 0, [each_row, rest = gradient.data()](Dim i) { return each_row * rest[i]; });
  });
}

}  // namespace supertac
