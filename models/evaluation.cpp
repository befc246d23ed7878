#include "models/evaluation.h"

#include <algorithm>
#include <stdexcept>

namespace supertac {

void for_each_output(const SuperTac& model, const WindowSet& data, std::span<const std::uint32_t> indices,
                     const std::function<bool(const EvaluatedBatch&)>& use) {
  constexpr std::size_t kBatch = 64;
  const Dim size = model.settings().image_size(), timesteps = model.settings().timesteps;
  if (data.timesteps() != timesteps || data.image_size() != size) {
    throw std::invalid_argument(
        "for_each_output: the windows do not have the model's length or picture size");
  }
  for (std::size_t first = 0; first < indices.size(); first += kBatch) {
    const std::size_t count = std::min(kBatch, indices.size() - first);
    Tensor windows(Shape{static_cast<Dim>(count), timesteps, kWindowTaxels});
    Tensor truths(Shape{static_cast<Dim>(count), size, size, 1});
    const std::size_t window_size = static_cast<std::size_t>(timesteps * kWindowTaxels);
    const std::size_t truth_size = static_cast<std::size_t>(size * size);
    for (std::size_t n = 0; n < count; ++n) {
      data.window(indices[first + n], windows.values().subspan(n * window_size, window_size));
      data.truth(indices[first + n], truths.values().subspan(n * truth_size, truth_size));
    }
    const Tensor outputs = model.infer(windows);
    if (!use({first, windows, outputs, truths})) return;
  }
}

}  // namespace supertac
