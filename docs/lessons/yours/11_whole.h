// ---- 11. The network: four autoencoders, one for each row of taxels, and an upsampler of what they know.
constexpr int kSide = 4, kTime = 128, kLatent = 10, kMaps = 8;
struct Example {
  Array window[kSide], eps[kSide];  // of a row of taxels: [taxel][time], 1: pressed; for sample()
  Array truth;                      // [16][16], 1: the plate's highest point
};
struct Drawn {
  Tensor picture, error, loss;  // the error that is expected of each pixel; what training makes smaller
};
Tensor attended(const std::string& /*name*/, const Tensor& x) {  // RCAB: a block with channel attention
  return x;  // Your part: two convolutions, the gates that they get, and the sum with x
}
Drawn draw(const Example& e) {
  static Products places[kSide];  // of a row's latents among all
  Tensor loss = tensor({1}), latents = tensor({kSide * kLatent});
  for (int g = 0; g < kSide; ++g) {
    const std::string in = "encoder." + std::to_string(g), out = "decoder." + std::to_string(g);
    const Tensor window = tensor({kSide, 1, kTime}, e.window[g]), eps = tensor({kLatent}, e.eps[g]);
    Tensor h = layer(in + ".conv.0", window, 16, kHalve, leaky_relu);
    for (const char* i : {".conv.1", ".conv.2", ".conv.3"}) h = layer(in + i, h, 32, kHalve, leaky_relu);
    h = layer(in + ".fc", each({h->size()}, {h}, same), 64, kOne, relu);
    const Tensor mean = layer(in + ".mean", h, kLatent, kOne);
    const Tensor log_var = layer(in + ".log_var", h, kLatent, kOne, limited);
    loss = add(loss, 0.2 * 1e-3, each({1}, {mean, log_var}, kld));
    const Tensor z = each(*mean, {mean, log_var, eps}, sample);
    for (int i = int(places[g].size()); i < kLatent; ++i) places[g].push_back({0, i, g * kLatent + i});
    latents = add(latents, 1, bilinear(*latents, one, z, places[g]));
    h = layer(out + ".fc.1", layer(out + ".fc.0", z, 64, kOne, relu), 2 * kTime, kOne, relu);
    h = each({32, 1, kTime / 16}, {h}, same);
    for (const char* i : {".conv.0", ".conv.1", ".conv.2", ".conv.3"})
      h = layer(out + i, h, h->w < 32 ? 32 : 16, kDouble, leaky_relu);
    const Tensor decoded = layer(out + ".out", h, kSide, kSame, sigmoid);
    loss = add(loss, 0.2 / window->size(), each({1}, {decoded, window}, squared_difference));
  }
  Tensor h = layer("upsampler.fc", latents, kMaps * kSide * kSide, kOne, leaky_relu);
  h = each({kMaps, kSide, kSide}, {h}, same);
  for (const std::string name : {"upsampler.rirb.0.", "upsampler.rirb.1."}) {
    const Tensor inner = layer(name + "conv", attended(name + "rcab.0.", h), kMaps, kSame);
    h = layer(name + "up", add(h, 1, inner), kMaps, kDouble, leaky_relu);
  }
  const Tensor picture = layer("upsampler.out", h, 1, kSame), error = layer("upsampler.spread", h, 1, kSame);
  const Tensor truth = tensor(*picture, e.truth), off = tensor(*picture);
  for (int i = 0; i < off->size(); ++i) off->value[i] = std::abs(picture->value[i] - e.truth[i]);
  loss = add(loss, 0.8 / off->size(), each({1}, {picture, truth}, squared_difference));
  loss = add(loss, 0.08 / off->size(), each({1}, {error, off}, squared_difference));
  const auto [low, high] = std::minmax_element(e.truth.begin(), e.truth.end());
  if (*high - *low >= 0.01) loss = add(add(loss, 0.08, one), -0.08, ssim(picture, truth));  // not if flat
  return {picture, error, loss};
}
// The gradient is no longer than 1, and the rate rises over 50 steps to 2e-3.
double train_step(const std::vector<Example>& batch, int step) {
  double loss = 0, squares = 0, n = double(batch.size());
  // Your part: the loss and the gradients of each example, the length of the whole gradient, Adam
  (void)squares, (void)n, (void)batch, (void)step;
  return loss;
}
// A finger of 4x4 taxels slides along x over waves or bumps. A taxel feels the mean height, and noise.
Example touch() {
  const double pitch = 2 + 3 * uniform(), x0 = pitch * uniform(), y0 = pitch * uniform(), round = uniform();
  const auto wave = [=](double at) { return 0.5 + 0.5 * std::cos(2 * M_PI * at / pitch); };
  const auto height = [=](double x, double y) { return wave(x + x0) * (round < 0.5 ? wave(y + y0) : 1); };
  Example e;
  for (int row = 0; row < kSide; ++row) {
    for (int i = 0; i < kSide * kTime; ++i) {
      const double x = i / kTime + 0.06 * (i % kTime - kTime + 1);
      e.window[row].push_back(0.01 * normal());
      for (int k = 0; k < 9; ++k) e.window[row].back() += height(x + k % 3 * 0.3, row + k / 3 * 0.3) / 9;
    }
    for (int i = 0; i < kLatent; ++i) e.eps[row].push_back(normal());
  }
  for (int i = 0; i < 256; ++i) e.truth.push_back(height(i % 16 / 4. - 0.075, i / 16 / 4. - 0.075));
  return e;
}

int main(int count, char** arguments) try {
  if (count > 1) load(arguments[1]);
  for (int step = 1; step <= 400; ++step) {
    std::vector<Example> batch(16);
    for (Example& e : batch) e = touch();
    const double loss = train_step(batch, step);
    if (step % 50 == 0 || step == 1) std::printf("step %3d  loss %.5f\n", step, loss), std::fflush(stdout);
  }
  const Example unseen = touch();
  const Drawn drawn = draw(unseen);
  std::ofstream file("mini_supertac.pgm", std::ios::binary);
  file << "P5 16 48 255\n";  // the truth, the picture, and the error that is expected of it
  for (const Array& pixels : {unseen.truth, drawn.picture->value, drawn.error->value})
    for (const double p : pixels) file.put(char(int(255 * std::clamp(p, 0.0, 1.0))));
} catch (const std::exception& e) {
  std::fprintf(stderr, "mini_supertac: %s\n", e.what());
  return 1;
}
