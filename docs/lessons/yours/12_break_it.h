// ---- 12. Four safeguards as they are before one knows better; mend them.
// By what a gradient of this length is multiplied, so that it is not longer than `limit`.
double clip_factor(double /*norm*/, double /*limit*/) { return 1; }
// The gradient of limited(), which keeps x within [-10, 10].
double clamp_gradient(double /*x*/, double gy) { return gy; }
// In single precision, never below 0.
float variance(const std::vector<float>& x) {
  float sum = 0, squares = 0;
  for (const float value : x) sum += value, squares += value * value;
  const float n = float(x.size());
  return squares / n - sum / n * (sum / n);
}
// Whether a window may hold these two times, one behind the other.
bool may_follow(double /*before_s*/, double /*after_s*/, double /*max_gap_s*/) { return true; }
