#include "models/networks/classifier.h"

#include <gtest/gtest.h>

#include "tests/expect_error.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

TEST(TextureClassifier, TakesFramesAndPictures) {
  Rng rng(1);
  EXPECT_EQ(TextureClassifier({.height = 4, .width = 4, .classes = 6}, rng)
                .forward(Variable(uniform({2, 4, 4, 1}, 1)))
                .shape(),
            (Shape{2, 6}));
  EXPECT_EQ(TextureClassifier({.height = 16, .width = 16, .classes = 3}, rng)
                .forward(Variable(uniform({2, 16, 16, 1}, 1)))
                .shape(),
            (Shape{2, 3}));
  EXPECT_EQ(TextureClassifier({.height = 1, .width = 1, .channels = 40, .classes = 4}, rng)
                .forward(Variable(uniform({3, 1, 1, 40}, 1)))
                .shape(),
            (Shape{3, 4}));
}

TEST(TextureClassifier, RefusesSettingsOutOfRange) {
  Rng rng(1);
  const std::pair<ClassifierSettings, const char*> refused[] = {
      {{.height = 0, .width = 4, .classes = 6}, "0x4, 1 and 6"},
      {{.height = 16, .width = 16, .classes = 1}, "16x16, 1 and 1"}};
  for (const auto& [settings, got] : refused)
    EXPECT_EQ(what_of<std::invalid_argument>([&, &s = settings] { TextureClassifier(s, rng); }),
              std::string("TextureClassifier: expects sides of 1 to 2048, a channel or more and 2 to 1024 "
                          "classes, got ") +
                  got);
}

}  // namespace
}  // namespace supertac
