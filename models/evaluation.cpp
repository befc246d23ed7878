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

void compute(const SuperTac& model, const WindowSet& data, std::span<const std::uint32_t> indices,
             Batch& batch) {
  const Dim size = model.settings().image_size(), timesteps = model.settings().timesteps;
  const auto count = static_cast<Dim>(indices.size());
  batch.windows = Tensor(Shape{count, timesteps, kWindowTaxels});
  batch.truths = Tensor(Shape{count, size, size, 1});
  const auto window_size = static_cast<std::size_t>(timesteps * kWindowTaxels);
  const auto truth_size = static_cast<std::size_t>(size * size);
  for (std::size_t n = 0; n < indices.size(); ++n) {
    data.window(indices[n], batch.windows.values().subspan(n * window_size, window_size));
    data.truth(indices[n], batch.truths.values().subspan(n * truth_size, truth_size));
  }
  batch.outputs = model.infer(batch.windows);
}

}  // namespace

void for_each_output(const SuperTac& model, const WindowSet& data, std::span<const std::uint32_t> indices,
                     const std::function<bool(const EvaluatedBatch&)>& use) {
  if (data.timesteps() != model.settings().timesteps || data.image_size() != model.settings().image_size()) {
    throw std::invalid_argument(
        "for_each_output: the windows do not have the model's length or picture size");
  }
  for (std::size_t start = 0; start < indices.size(); start += kBatch * kBatchesAtOnce) {
    std::vector<Batch> batches;
    const std::size_t end = std::min(indices.size(), start + kBatch * kBatchesAtOnce);
    for (std::size_t first = start; first < end; first += kBatch) batches.push_back({first, {}, {}, {}, {}});
#pragma omp parallel for schedule(static, 1)
    for (std::size_t i = 0; i < batches.size(); ++i) {
      try {
        const std::size_t count = std::min(kBatch, indices.size() - batches[i].first);
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

}  // namespace supertac
