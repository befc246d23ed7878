#include "models/networks/frame_model.h"

#include <gtest/gtest.h>

#include "tests/models/support.h"

namespace supertac {
namespace {

TEST(FrameModel, DrawsAnyArrayAtEveryScale) {
  for (const Dim scale : {2, 4, 8, 16}) {
    Rng rng(1);
    const FrameModel model(
        {.in_channels = 3, .height = 2, .width = 5, .scale = scale, .channels = 8, .rcabs = 1}, rng);
    EXPECT_EQ(model.infer(uniform({2, 2, 5, 3}, 1)).shape(), (Shape{2, 2 * scale, 5 * scale, 1}));
    EXPECT_THROW(model.infer(uniform({2, 5, 2, 3}, 1)), std::invalid_argument);
  }
  Rng rng(1);
  EXPECT_THROW(FrameModel({.scale = 3}, rng), std::invalid_argument);
  EXPECT_THROW(FrameModel({.in_channels = 0}, rng), std::invalid_argument);
  EXPECT_EQ(FrameModel({.channels = 8, .rcabs = 1}, rng).parameters()[0].name, "in.weight");
}

}  // namespace
}  // namespace supertac
