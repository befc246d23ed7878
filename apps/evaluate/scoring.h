// What is tested, and the one loop that draws it.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "data/scores/baselines.h"
#include "data/windows/split.h"
#include "models/files/model_file.h"

namespace supertac {

/// Which examples are tested; what the first model was trained with, unless the options say otherwise.
struct TestSet {
  std::string split_name;
  std::uint64_t seed = 0;
  std::vector<std::string> leave_out;  ///< of split texture, the plates tested; none = drawn with the seed
  Split split;  ///< its test side is tested, the baselines are fitted to its training side
};

/// --split and --seed, or the model's own; the split itself is left to the caller.
TestSet test_set_of(const Arguments& a, const ModelFile& file);

/// Cuts the test side to --history and --limit. Throws std::runtime_error when what one model is tested on
/// may be what another was trained on (not where --split none asks for all of them), or no example is left to
/// fit the baselines to.
void check_test_set(const Arguments& a, const std::vector<ModelFile>& files, const WindowSet& windows,
                    TestSet& tested);

/// One example with its pictures: that of the network first, then those of the baselines.
struct Drawn {
  std::uint32_t example;
  std::span<const float> target;
  std::vector<std::span<const float>> pictures;
  std::span<const float> predicted_error;  ///< of the network's; empty where it has none
  std::span<const float> input;            ///< as the network takes it
};

/// Draws the test side in order, with a progress bar. Throws Interrupted after a signal.
void draw_all(const Arguments& a, const Ensemble& network, const WindowSet& windows,
              std::span<const std::uint32_t> test, const Baselines& baselines,
              const std::function<void(const Drawn&)>& use);

}  // namespace supertac
