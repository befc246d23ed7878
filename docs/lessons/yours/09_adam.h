// ---- 9. Adam (Kingma & Ba 2015), of one tensor whose gradient is multiplied by `clip`, then forgotten.
void adam(Node& w, double clip, double rate, int step) {
  for (int i = 0; i < w.size(); ++i) {
    const double g = clip * w.grad[i];
    w.m[i] += 0.1 * (g - w.m[i]), w.v[i] += 0.001 * (g * g - w.v[i]), w.grad[i] = 0;
    (void)rate, (void)step;  // Your part: the step
  }
}
