// Runs a model over the windows of a data set.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "data/samples/windows.h"
#include "data/scores/metrics.h"
#include "models/committee.h"

namespace supertac {

/// Whether a model takes windows of this length, array and picture size.
bool fits(const WindowSet& windows, const SuperTacSettings& model);

/// A batch of results: windows [n,T,signals], outputs and truths [n,H,W,1], and the first of their places in
/// `indices`.
struct EvaluatedBatch {
  std::size_t first;
  const Tensor& windows;
  const Tensor& outputs;
  const Tensor& truths;
};

/// Calls `use` for the given windows in order, in batches of at most 64. `use` returns false to stop early.
/// Batches are computed on several threads, `use` runs on the caller's. Throws std::invalid_argument when the
/// data set's windows do not fit the model.
void for_each_output(const Committee& model, const WindowSet& windows, std::span<const std::uint32_t> indices,
                     const std::function<bool(const EvaluatedBatch&)>& use);

/// The metrics of the model's pictures of the given windows. `stop`, if given, is asked between batches; once
/// it says true, the windows so far are what was measured. Throws as for_each_output.
ContactMetrics score(const Committee& model, const WindowSet& windows, std::span<const std::uint32_t> indices,
                     bool (*stop)() = nullptr);

}  // namespace supertac
