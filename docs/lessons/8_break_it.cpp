// Lesson 8: break it. Four safeguards as they are before one knows better; mend them.
#include "lessons.h"

namespace lessons {

double clip_factor(double /*norm*/, double /*limit*/) { return 1; }

double clamp_gradient(double /*x*/, double gy) { return gy; }

float variance(std::span<const float> x) {
  float sum = 0, squares = 0;
  for (const float value : x) sum += value, squares += value * value;
  const float n = static_cast<float>(x.size());
  return squares / n - sum / n * (sum / n);
}

bool may_follow(double /*before_s*/, double /*after_s*/, double /*max_gap_s*/) { return true; }

}  // namespace lessons
