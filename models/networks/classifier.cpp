#include "models/networks/classifier.h"

#include <algorithm>
#include <stdexcept>

#include "autograd/ops/activations.h"
#include "autograd/ops/shaping.h"

namespace supertac {

TextureClassifier::TextureClassifier(const ClassifierSettings& s, Rng& rng) {
  constexpr Dim kFirst = 16, kSecond = 32, kHidden = 64;
  const auto side = [](Dim pixels) { return pixels >= 1 && pixels <= 2048; };
  if (!side(s.height) || !side(s.width) || s.channels < 1 || s.classes < 2 || s.classes > 1024)
    throw std::invalid_argument(
        "TextureClassifier: expects sides of 1 to 2048, a channel or more and 2 to 1024 "
        "classes, got " +
        std::to_string(s.height) + "x" + std::to_string(s.width) + ", " + std::to_string(s.channels) +
        " and " + std::to_string(s.classes));
  if (std::min(s.height, s.width) < 4) {
    add("hidden", hidden_.emplace(s.height * s.width * s.channels, kHidden, rng));
    add("out", out_.emplace(kHidden, s.classes, rng));
    return;
  }
  add("conv.0", first_.emplace(s.channels, kFirst, kSameSize, rng));
  add("conv.1", second_.emplace(kFirst, kSecond, kSameSize, rng));
  add("out", out_.emplace(kSecond * (s.height / 4) * (s.width / 4), s.classes, rng));
}

Variable TextureClassifier::forward(const Variable& x) const {
  if (hidden_) return out_->forward(hidden_->forward(flatten_channels_first(x), kRelu));
  const Variable fine = max_pool2d(first_->forward(x, kRelu));        // [N,H,W,channels] -> [N,H/2,W/2,16]
  const Variable coarse = max_pool2d(second_->forward(fine, kRelu));  // [N,H/4,W/4,32]
  return out_->forward(flatten_channels_first(coarse));               // [N,classes]
}

}  // namespace supertac
