#include "models/networks/cost.h"

#include <gtest/gtest.h>

#include "tests/expect_error.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

// How often a weight is used: once for each pixel of the coarser side of its layer.
Dim uses(const std::string& name, const SuperTacSettings& s) {
  const auto level = [&](const char* mark) {
    return std::stoi(name.substr(name.find(mark) + std::string(mark).size()));
  };
  if (name.find("attention") != std::string::npos || name.find("fc") != std::string::npos) return 1;
  if (name.find("last_frame") != std::string::npos) return s.rows * s.columns;
  if (name.find("rirb.") != std::string::npos) return s.rows * s.columns << (2 * level("rirb."));
  if (name.find("upsampler.out") != std::string::npos) return s.image_height() * s.image_width();
  if (name.find("encoder") != std::string::npos && name.find("conv.") != std::string::npos)
    return s.timesteps >> (level("conv.") + 1);
  if (name.find("decoder") != std::string::npos && name.find("conv.") != std::string::npos)
    return s.timesteps / 16 << level("conv.");
  if (name.find("decoder") != std::string::npos) return s.timesteps;  // out
  return 1;                                                           // heads
}

TEST(Cost, AgreesWithTheWeightsOfTheModel) {
  for (const Dim scale : {2, 4, 8}) {
    const bool rig = scale == 4;
    SuperTacSettings s{.rows = rig ? 4 : 5,
                       .columns = rig ? 4 : 12,
                       .in_channels = rig ? 1 : 3,
                       .timesteps = 64,
                       .latent = 5,
                       .scale = scale,
                       .channels = 12,
                       .rcabs = 2,
                       .last_frame_path = scale == 8};
    const SuperTac model = random_network(s);
    double inference = 0, forward = 0;
    for (const Parameter& p : model.parameters()) {
      if (p.name.ends_with("bias")) continue;
      const auto macs = static_cast<double>(p.value.value().size() * uses(p.name, s));
      forward += macs;
      if (!p.name.starts_with("decoder") && p.name.find("log_var") == std::string::npos) inference += macs;
    }
    EXPECT_EQ(cost_of(s).inference, inference) << scale;
    EXPECT_EQ(cost_of(s).training, 3 * forward) << scale;
  }
}

TEST(Cost, OfThePresetPaperIsAboutEightMillionOfTinyANinth) {
  const double paper = cost_of(SuperTacSettings::of_preset("paper")).inference;
  EXPECT_NEAR(paper, 7.8e6, 0.1e6);
  EXPECT_LT(9 * cost_of(SuperTacSettings::of_preset("tiny")).inference, paper);
  EXPECT_EQ(
      what_of<std::invalid_argument>([&] { cost_of({.timesteps = 40}); }),
      "model settings: timesteps must be a multiple of 16 (the encoder halves four times) or 1, got 40");
}

}  // namespace
}  // namespace supertac
