// ---- 12. The four safeguards as they should be.
double clip_factor(double norm, double limit) { return std::min(1.0, limit / norm); }
double clamp_gradient(double x, double gy) { return std::abs(x) <= 10 ? gy : 0; }
float variance(const std::vector<float>& x) {
  const float n = float(x.size());
  float mean = 0, sum = 0;
  for (const float value : x) mean += value / n;
  for (const float value : x) sum += (value - mean) * (value - mean);
  return sum / n;
}
bool may_follow(double before_s, double after_s, double max_gap_s) { return after_s - before_s <= max_gap_s; }
