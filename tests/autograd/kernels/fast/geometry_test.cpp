#include "autograd/kernels/fast/geometry.h"

#include <gtest/gtest.h>

#include <set>

namespace supertac::kernels {
namespace {

ConvSettings settings(bool transposed) {
  return {.height = 5,
          .width = 4,
          .kernel_h = 4,
          .kernel_w = 3,
          .stride_h = 2,
          .stride_w = 2,
          .padding_h = 1,
          .padding_w = 1,
          .transposed = transposed};
}

TEST(Geometry, OutputSizes) {
  EXPECT_EQ(settings(false).out_height(), 2);
  EXPECT_EQ(settings(false).out_width(), 2);
  EXPECT_EQ(settings(true).out_height(), 10);
  EXPECT_EQ(settings(true).out_width(), 7);
}

// Forward, backward and pairs are three orders of one set of (tap, input, output).
TEST(Geometry, AllThreeTablesHoldTheSameTriples) {
  for (const bool transposed : {false, true}) {
    const Geometry& g = geometry_of(settings(transposed));
    std::set<std::array<std::int32_t, 3>> forward, backward, pairs;
    const auto collect = [](const std::vector<Phase>& phases, bool swapped, auto& into) {
      for (const Phase& phase : phases) {
        for (std::size_t q = 0; q < phase.outputs.size(); ++q) {
          for (std::size_t t = 0; t < phase.taps.size(); ++t) {
            const std::int32_t source = phase.sources[q * phase.taps.size() + t];
            if (source < 0) continue;
            if (swapped) {
              into.insert({phase.taps[t], phase.outputs[q], source});
            } else {
              into.insert({phase.taps[t], source, phase.outputs[q]});
            }
          }
        }
      }
    };
    collect(g.forward, false, forward);
    collect(g.backward, true, backward);
    for (std::size_t t = 0; t < g.pairs.size(); ++t) {
      for (std::size_t i = 0; i < g.pairs[t].inputs.size(); ++i) {
        pairs.insert({static_cast<std::int32_t>(t), g.pairs[t].inputs[i], g.pairs[t].outputs[i]});
      }
    }
    EXPECT_FALSE(pairs.empty());
    EXPECT_EQ(forward, pairs);
    EXPECT_EQ(backward, pairs);
  }
}

TEST(Geometry, EveryOutputBelongsToOnePhase) {
  const Geometry& g = geometry_of(settings(true));
  std::multiset<std::int32_t> outputs;
  for (const Phase& phase : g.forward) outputs.insert(phase.outputs.begin(), phase.outputs.end());
  EXPECT_EQ(static_cast<Dim>(outputs.size()), g.out_pixels);
  EXPECT_EQ(static_cast<Dim>(std::set<std::int32_t>(outputs.begin(), outputs.end()).size()), g.out_pixels);
  EXPECT_EQ(g.forward.size(), 4U);  // stride 2 x 2
}

TEST(Geometry, IsBuiltOnce) { EXPECT_EQ(&geometry_of(settings(true)), &geometry_of(settings(true))); }

}  // namespace
}  // namespace supertac::kernels
