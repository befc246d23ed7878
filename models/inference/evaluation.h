// Runs a network over windows.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "data/scores/metrics.h"
#include "data/windows/windows.h"
#include "models/inference/compiled/compiled_model.h"

namespace supertac {

/// Throws std::invalid_argument naming both formats when windows or truths are not those of the network.
void check_format(const WindowSet& windows, const SuperTac& network);

/// A batch of results: inputs as the network takes them, outputs, predicted errors and targets [n,H,W,1], and
/// the first of their places in `indices`. Predicted errors are empty where the network has none.
struct EvaluatedBatch {
  std::size_t first;
  Tensor inputs, outputs, targets;
  std::vector<float> predicted_errors = {};

  std::size_t size() const { return static_cast<std::size_t>(inputs.dim(0)); }
  std::span<const float> input(std::size_t n) const { return sample(inputs.values(), n); }
  std::span<const float> output(std::size_t n) const { return sample(outputs.values(), n); }
  std::span<const float> target(std::size_t n) const { return sample(targets.values(), n); }
  /// Empty where the network has none.
  std::span<const float> predicted_error(std::size_t n) const { return sample(predicted_errors, n); }

 private:
  std::span<const float> sample(std::span<const float> all, std::size_t n) const {
    const std::size_t values = all.size() / size();
    return all.subspan(n * values, values);
  }
};

/// Calls `use` for the given windows in order, in batches of at most 64. `use` returns false to stop early.
/// Batches are computed on several threads, `use` runs on the caller's. Throws as check_format.
void for_each_output(const Ensemble& network, const WindowSet& windows,
                     std::span<const std::uint32_t> indices,
                     const std::function<bool(const EvaluatedBatch&)>& use);

/// The metrics of the network's pictures of the given windows. `stop`, if given, is asked between batches;
/// once it says true, the windows so far are what was measured. Throws as for_each_output.
ZoneMetrics score(const Ensemble& network, const WindowSet& windows, std::span<const std::uint32_t> indices,
                  const std::function<bool()>& stop = {});

}  // namespace supertac
