#include "models/evaluation.h"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <vector>

namespace supertac {
namespace {

constexpr std::size_t kBatch = 64, kBatchesAtOnce = 4;

struct Batch {
  std::size_t first;
  Tensor windows, outputs, truths;
  std::exception_ptr error;
};

void compute(const Committee& model, const WindowSet& data, std::span<const std::uint32_t> indices,
             Batch& batch) {
  const auto window_size = batch.windows.values().size() / indices.size();
  const auto truth_size = batch.truths.values().size() / indices.size();
  for (std::size_t n = 0; n < indices.size(); ++n) {
    data.window(indices[n], batch.windows.values().subspan(n * window_size, window_size));
    data.truth(indices[n], batch.truths.values().subspan(n * truth_size, truth_size));
  }
  // Copied, so that what this thread took from its pool goes back there.
  const Tensor outputs = model.infer(batch.windows);
  std::copy_n(outputs.data(), outputs.size(), batch.outputs.data());
}

}  // namespace

bool fits(const WindowSet& windows, const SuperTacSettings& model) {
  const TaxelArray array = windows.array();
  return windows.timesteps() == model.timesteps && windows.settings().scale == model.scale &&
         array.rows == model.rows && array.columns == model.columns && array.channels == model.in_channels;
}

void for_each_output(const Committee& model, const WindowSet& data, std::span<const std::uint32_t> indices,
                     const std::function<bool(const EvaluatedBatch&)>& use) {
  const SuperTacSettings& s = model.settings();
  if (!fits(data, s)) {
    throw std::invalid_argument(
        "for_each_output: the windows do not have the model's length, array or picture size");
  }
  for (std::size_t start = 0; start < indices.size(); start += kBatch * kBatchesAtOnce) {
    std::vector<Batch> batches;
    const std::size_t end = std::min(indices.size(), start + kBatch * kBatchesAtOnce);
    for (std::size_t first = start; first < end; first += kBatch) {
      const auto count = static_cast<Dim>(std::min(kBatch, end - first));
      const Shape pictures{count, s.image_height(), s.image_width(), 1};
      batches.push_back(
          {first, Tensor(Shape{count, s.timesteps, s.signals()}), Tensor(pictures), Tensor(pictures), {}});
    }
#pragma omp parallel for schedule(static, 1)
    for (std::size_t i = 0; i < batches.size(); ++i) {
      try {
        const auto count = static_cast<std::size_t>(batches[i].windows.dim(0));
        compute(model, data, indices.subspan(batches[i].first, count), batches[i]);
      } catch (...) {  // an exception must not leave a thread
        batches[i].error = std::current_exception();
      }
    }
    for (const Batch& b : batches) {
      if (b.error) std::rethrow_exception(b.error);
      if (!use({b.first, b.windows, b.outputs, b.truths})) return;
    }
  }
}

ContactMetrics score(const Committee& model, const WindowSet& windows, std::span<const std::uint32_t> indices,
                     bool (*stop)()) {
  const std::size_t pixels = windows.image().pixels();
  ContactMetrics metrics(windows.image());
  for_each_output(model, windows, indices, [&](const EvaluatedBatch& b) {
    for (std::size_t n = 0; n < static_cast<std::size_t>(b.outputs.dim(0)); ++n) {
      metrics.add(b.outputs.values().subspan(n * pixels, pixels),
                  b.truths.values().subspan(n * pixels, pixels));
    }
    return stop == nullptr || !stop();
  });
  return metrics;
}

}  // namespace supertac
