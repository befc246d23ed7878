#include "models/inference/evaluation.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "io/numbers/parallel.h"

namespace supertac {
namespace {

constexpr std::size_t kBatch = 64, kBatchesAtOnce = 4;

void compute(const Ensemble& network, const WindowSet& data, std::span<const std::uint32_t> indices,
             EvaluatedBatch& part) {
  const std::size_t input_size = data.input_size(), target_size = data.image().pixels();
  for (std::size_t n = 0; n < indices.size(); ++n) {
    data.window(indices[n], part.inputs.values().subspan(n * input_size, input_size));
    data.truth(indices[n], part.targets.values().subspan(n * target_size, target_size));
  }
  // Copied, so that what this thread took from its pool goes back there.
  const Estimate estimate = network.estimate(part.inputs);
  std::copy_n(estimate.picture.data(), estimate.picture.size(), part.outputs.data());
  part.predicted_errors.assign(estimate.predicted_error.values().begin(),
                               estimate.predicted_error.values().end());
}

}  // namespace

void check_format(const WindowSet& windows, const SuperTac& network) {
  const TaxelArray array = windows.array();
  const NetworkFormat own{static_cast<Dim>(windows.frames()), array.rows, array.columns, array.channels,
                          windows.scale()};
  if (own != network.format())
    throw std::invalid_argument("the data have " + text(own) + ", the model expects " +
                                text(network.format()));
}

void for_each_output(const Ensemble& network, const WindowSet& data, std::span<const std::uint32_t> indices,
                     const std::function<bool(const EvaluatedBatch&)>& use) {
  check_format(data, network.first());
  for (std::size_t start = 0; start < indices.size(); start += kBatch * kBatchesAtOnce) {
    std::vector<EvaluatedBatch> parts;
    const std::size_t end = std::min(indices.size(), start + kBatch * kBatchesAtOnce);
    for (std::size_t first = start; first < end; first += kBatch) {
      const auto count = static_cast<Dim>(std::min(kBatch, end - first));
      const Shape pictures = network.first().picture_shape(count);
      parts.push_back(
          {first, Tensor(network.first().input_shape(count)), Tensor(pictures), Tensor(pictures)});
    }
    parallel_for(parts.size(), [&](std::size_t i) {
      compute(network, data, indices.subspan(parts[i].first, parts[i].size()), parts[i]);
    });
    for (const EvaluatedBatch& part : parts)
      if (!use(part)) return;
  }
}

ZoneMetrics score(const Ensemble& network, const WindowSet& windows, std::span<const std::uint32_t> indices,
                  const std::function<bool()>& stop) {
  ZoneMetrics metrics(windows.image());
  for_each_output(network, windows, indices, [&](const EvaluatedBatch& b) {
    for (std::size_t n = 0; n < b.size(); ++n)
      metrics.add(b.output(n), b.target(n), windows.zone(indices[b.first + n]), windows.contact_level());
    return !stop || !stop();
  });
  return metrics;
}

}  // namespace supertac
