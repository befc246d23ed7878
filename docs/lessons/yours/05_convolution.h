// ---- 5. Convolution: place p of x meets place q of y under tap k where p = q stride + k - pad:
//   y[o][q] = sum over i, k of w[o][i][k] x[i][q stride + k - pad].
// The transpose exchanges x and y, and has w[i][o][k]. Along time a kernel is a row; kOne is a linear layer.
struct Kernel {
  int size, stride = 1, pad = 0;
  bool up = false;  // the transpose
  int out(int n) const { return up ? (n - 1) * stride - 2 * pad + size : (n + 2 * pad - size) / stride + 1; }
};
constexpr Kernel kSame{3, 1, 1}, kHalve{3, 2, 1}, kDouble{4, 2, 1, true}, kOne{1};
Tensor convolve(const std::string& name, const Tensor& w, const Tensor& x, int outputs, Kernel k) {
  static std::map<std::string, Products> known;  // by layer: found once
  Products& products = known[name];
  const int taps = w->size() / (outputs * x->c);
  const Shape y{outputs, x->h == 1 ? 1 : k.out(x->h), k.out(x->w)};
  const Shape fine = k.up ? y : *x, coarse = k.up ? *x : y;
  for (int at = products.empty() ? 0 : w->size(); at < w->size(); ++at) {
    const int tap = at % taps, i = at / taps % x->c, o = at / taps / x->c;
    for (int q = 0; q < coarse.h * coarse.w; ++q) {
      // Your part: push_back({place in w, place in x, place in y}) where this tap meets place q of `coarse`.
      (void)tap, (void)i, (void)o, (void)q, (void)fine;
    }
  }
  return bilinear(y, w, x, products);
}
