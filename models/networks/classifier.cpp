#include "models/networks/classifier.h"

#include <stdexcept>

#include "autograd/ops/activations.h"
#include "autograd/ops/max_pool.h"
#include "autograd/ops/shaping.h"

namespace supertac {
namespace {

constexpr Dim kFirst = 16, kSecond = 32, kHidden = 64;

Dim features(const ClassifierSettings& s) {
  const auto side = [](Dim pixels) { return pixels >= 4 && pixels <= 2048; };
  if (!side(s.height) || !side(s.width) || s.channels < 1 || s.classes < 2 || s.classes > 1024) {
    throw std::invalid_argument(
        "TextureClassifier: expects sides of 4 to 2048, a channel or more and 2 to 1024 "
        "classes, got " +
        std::to_string(s.height) + "x" + std::to_string(s.width) + ", " + std::to_string(s.channels) +
        " and " + std::to_string(s.classes));
  }
  return kSecond * (s.height / 4) * (s.width / 4);
}

Dim checked_features(Dim features, Dim classes) {
  if (features < 1 || classes < 2 || classes > 1024) {
    throw std::invalid_argument("FeatureClassifier: expects at least 1 feature and 2 to 1024 classes, got " +
                                std::to_string(features) + " and " + std::to_string(classes));
  }
  return features;
}

}  // namespace

TextureClassifier::TextureClassifier(const ClassifierSettings& s, Rng& rng)
    : first_(s.channels, kFirst, kSameSize, rng),
      second_(kFirst, kSecond, kSameSize, rng),
      out_(features(s), s.classes, rng) {
  add("conv.0", first_);
  add("conv.1", second_);
  add("out", out_);
}

Variable TextureClassifier::forward(const Variable& x) const {
  const Variable fine = max_pool2d(first_.forward(x, kRelu));        // [N,H,W,channels] -> [N,H/2,W/2,16]
  const Variable coarse = max_pool2d(second_.forward(fine, kRelu));  // [N,H/4,W/4,32]
  return out_.forward(flatten_channels_first(coarse));               // [N,classes]
}

FeatureClassifier::FeatureClassifier(Dim features, Dim classes, Rng& rng)
    : hidden_(checked_features(features, classes), kHidden, rng), out_(kHidden, classes, rng) {
  add("hidden", hidden_);
  add("out", out_);
}

Variable FeatureClassifier::forward(const Variable& x) const {
  return out_.forward(hidden_.forward(x, kRelu));  // [N,features], [N,64], [N,classes]
}

}  // namespace supertac
