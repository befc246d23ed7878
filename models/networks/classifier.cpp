#include "models/networks/classifier.h"

#include <algorithm>

#include "autograd/ops/activations.h"
#include "autograd/ops/shaping.h"
#include "autograd/record.h"

namespace supertac {

TextureClassifier::TextureClassifier(const ClassifierSettings& s, Rng& rng) {
  constexpr Dim kFirst = 16, kSecond = 32, kHidden = 64;
  check_between("TextureClassifier", "height", s.height, 1, 2048);
  check_between("TextureClassifier", "width", s.width, 1, 2048);
  check_at_least("TextureClassifier", "channels", s.channels, 1);
  check_between("TextureClassifier", "classes", s.classes, 2, 1024);
  if (std::min(s.height, s.width) < 4) {
    hidden_.emplace(add("hidden", Linear(s.height * s.width * s.channels, kHidden, rng)));
    out_.emplace(add("out", Linear(kHidden, s.classes, rng)));
    return;
  }
  first_.emplace(add("conv.0", Conv2d(s.channels, kFirst, kSameSize, rng)));
  second_.emplace(add("conv.1", Conv2d(kFirst, kSecond, kSameSize, rng)));
  out_.emplace(add("out", Linear(kSecond * (s.height / 4) * (s.width / 4), s.classes, rng)));
}

Variable TextureClassifier::forward(const Variable& x) const {
  if (hidden_) return out_->forward(hidden_->forward(flatten_channels_first(x), kRelu));
  // x [N,H,W,channels]
  const Variable fine = max_pool2d(first_->forward(x, kRelu));        // [N,H/2,W/2,16]
  const Variable coarse = max_pool2d(second_->forward(fine, kRelu));  // [N,H/4,W/4,32]
  return out_->forward(flatten_channels_first(coarse));               // [N,classes]
}

}  // namespace supertac
