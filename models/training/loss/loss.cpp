#include "models/training/loss/loss.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "autograd/ops/arithmetic.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/vae.h"
#include "autograd/record.h"
#include "io/numbers/numbers.h"

namespace supertac {

void LossWeights::check() const {
  if (!(a >= 0 && a <= 1)) refuse("loss", "a", "0 to 1", digits(a));
  if (!(beta >= 0)) refuse("loss", "beta", "0 or more", digits(beta));
  if (!(lambda >= 0)) refuse("loss", "lambda", "0 or more", digits(lambda));
}

void LossTerms::add(const LossTerms& other) {
  total += other.total, reconstruction += other.reconstruction, kld += other.kld;
  l2 += other.l2, ssim += other.ssim;
}

std::string LossTerms::text() const {
  const bool has_vaes = reconstruction != 0 || kld != 0;
  return "the loss is " + format(total) + " (" +
         (has_vaes ? "reconstruction " + format(reconstruction) + ", KLD " + format(kld) + ", " : "") +
         "L2 " + format(l2) + ", SSIM " + format(ssim) + ")";
}

LossTerms terms_of(const Loss& loss, double share) {
  const auto value = [share](const Variable& term) {
    return term.defined() ? share * static_cast<double>(term.item()) : 0;
  };
  return {value(loss.total), value(loss.reconstruction), value(loss.kld), value(loss.l2), value(loss.ssim)};
}

// picture, truth [N,H,W,1] -> the pictures, with the truth itself in place of those whose truth is flat.
static Variable where_textured(const Variable& picture, const Tensor& truth) {
  const Dim images = truth.dim(0), pixels = truth.size() / images;
  Tensor keep(truth.shape()),
      flat(truth.shape());  // 1 and 0 of a textured one, 0 and the truth of a flat one
  for (Dim n = 0; n < images; ++n) {
    const std::span<const real> values(truth.data() + n * pixels, static_cast<std::size_t>(pixels));
    const auto [least, most] = std::ranges::minmax(values);
    const bool textured = most - least >= kLeastTexture;
    std::fill_n(keep.data() + n * pixels, pixels, textured ? real(1) : real(0));
    for (Dim i = n * pixels; i < (n + 1) * pixels; ++i) flat.data()[i] = textured ? 0 : truth.data()[i];
  }
  return picture * Variable(keep) + Variable(flat);
}

// picture, truth [N,H,W,1]; all terms scalars []
Loss picture_loss(const Variable& picture, const Tensor& truth, double lambda) {
  const Variable target(truth);
  check_shape("picture_loss", "truth", target, picture.shape());
  Loss loss;
  loss.l2 = l2_loss(picture, target);
  loss.ssim = ssim(where_textured(picture, truth), truth);
  loss.total = loss.l2 + static_cast<real>(lambda) * (1 - loss.ssim);
  return loss;
}

// |picture - truth| [N,H,W,1], a constant.
static Variable error_of(const Variable& picture, const Tensor& truth) {
  Tensor error(truth.shape());
  for (Dim i = 0; i < error.size(); ++i)
    error.data()[i] = std::abs(picture.value().data()[i] - truth.data()[i]);
  return Variable(error);
}

// Of each group input and decoded [N,T,group_signals], mean and log_var [N,LD]; predicted_error as the
// picture.
Loss supertac_loss(const SuperTac::Output& output, const Tensor& truth, const LossWeights& w) {
  Loss loss = picture_loss(output.picture, truth, w.lambda);
  for (std::size_t i = 0; i < output.decoded.size(); ++i) {
    const Variable l2 = l2_loss(output.decoded[i], output.input[i]);
    const Variable kld = kl_divergence(output.latent[i].mean, output.latent[i].log_var);
    loss.reconstruction = i == 0 ? l2 : loss.reconstruction + l2;
    loss.kld = i == 0 ? kld : loss.kld + kld;
  }
  if (output.predicted_error.defined()) {
    loss.predicted_error = l2_loss(output.predicted_error, error_of(output.picture, truth));
    loss.total = loss.total + static_cast<real>(kPredictedErrorWeight) * loss.predicted_error;
  }
  if (output.decoded.size() == 0) return loss;
  const auto share = static_cast<real>(w.a), rest = static_cast<real>(1 - w.a);
  const Variable vaes = share * loss.reconstruction + share * static_cast<real>(w.beta) * loss.kld;
  loss.total = vaes + rest * loss.total;
  return loss;
}

}  // namespace supertac
