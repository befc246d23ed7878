// ---- 8. SSIM (Wang et al. 2004): windowed by a Gaussian of 11x11, sigma 1.5, the mean over the window's
// places of n1 n2 / (d1 d2), n1 = 2 mx my + C1, n2 = 2 cov + C2, d1 = mx^2 + my^2 + C1, d2 = vx + vy + C2.
Tensor ssim(const Tensor& x, const Tensor& y) {
  const Tensor gauss = tensor({121});
  double all = 0;
  for (int i = 0; i < 121; ++i)
    all += gauss->value[i] = std::exp(-(std::pow(i / 11 - 5, 2) + std::pow(i % 11 - 5, 2)) / 4.5);
  for (double& g : gauss->value) g /= all;
  const auto blur = [=](auto a, auto b) {
    return convolve("ssim", gauss, each(*a, {a, b}, product), 1, {11});
  };
  const auto term = [](In a) {
    const double n1 = 2 * a[0] * a[1] + 1e-4, d1 = a[0] * a[0] + a[1] * a[1] + 1e-4;
    const double n2 = 2 * (a[4] - a[0] * a[1]) + 9e-4, d2 = a[2] + a[3] - a[0] * a[0] - a[1] * a[1] + 9e-4;
    const double s = n1 * n2 / (d1 * d2);
    const double by_mean = 0, by_var = 0, by_cov = 0;  // Your part: of s by mx, by blur(x, x), by blur(x, y)
    return Term{s, by_mean, 0, by_var, 0, by_cov};     // y is the truth: nobody asks for its slopes
  };
  const Tensor mx = blur(x, one), my = blur(y, one);
  return add(tensor({1}), 1. / mx->size(), each({1}, {mx, my, blur(x, x), blur(y, y), blur(x, y)}, term));
}
Term squared_difference(In a) { return {std::pow(a[0] - a[1], 2), 0, 0}; }
