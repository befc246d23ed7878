// The steps of a compiled model and the memory that they work on.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "autograd/kernels/fast/inference.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/inference/compiled/taps.h"
#include "models/networks/supertac_model.h"

namespace supertac {

/// One block of images on its way through the steps.
struct Block {
  const real* input = nullptr;
  Dim images = 0;
  real* workspace = nullptr;
  real* scratch = nullptr;    ///< of the step that runs
  bool filters_anew = false;  ///< Winograd's filters are transformed on the way

  real* begin(const FeatureMap& map) const { return workspace + map.offset * images; }
  real* first_pixel(const FeatureMap& map) const { return begin(map) + map.origin(); }
};

using PlanStep = std::function<void(const Block&)>;

class Plan {
 public:
  Estimate run(const Tensor& inputs) const;
  /// Whether few pictures have Winograd's filters transformed on the way: the same bits from less memory.
  bool filters_anew() const { return filters_anew_; }

 private:
  friend class Compiler;
  FeatureMap add_buffer(FeatureMap layout);
  void clear_margins(const Block& block) const;
  void copy_out(const Block& block, const FeatureMap& map, Tensor& to, Dim first) const;

  /// Images that go through the steps together. They share the weights on their way from memory, but what
  /// they leave behind must stay in the second cache: one of kLargeCache bytes has room for kLargeBlock.
  static constexpr Dim kBlock = 8, kLargeBlock = 16;
  static constexpr std::size_t kLargeCache = std::size_t{2} << 20;

  std::vector<PlanStep> steps_;
  std::vector<FeatureMap> buffers_;  // each once
  std::vector<FeatureMap> planes_;   // those with margins inside: of one image, channel by channel
  Dim workspace_ = 0;                // numbers of an image
  Dim scratch_ = 0;                  // numbers
  FeatureMap picture_;
  std::optional<FeatureMap> predicted_error_, latents_;
  Dim block_ = kBlock;
  bool filters_anew_ = false;
};

}  // namespace supertac
