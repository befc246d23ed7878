// SuperTac in one file: gradients, the network of the preset `tiny`, its loss, Adam, and a simulated finger.
//   c++ -std=c++20 -O3 mini_supertac.cpp -o mini_supertac
//   ./mini_supertac [MODEL.safetensors]      trains for a minute, then writes mini_supertac.pgm
// It begins with random weights, or with those of a model of supertac-train --preset tiny: names and order of
// numbers are PyTorch's in both. One example is computed at a time; a batch adds up their gradients.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

// ---- 1. Scalars. A term is a number made of others, a[0], a[1], ..., and its derivatives by them.
using In = const double*;
using Term = std::array<double, 6>;
Term same(In a) { return {a[0], 1}; }
Term relu(In a) { return a[0] > 0 ? Term{a[0], 1} : Term{0, 0}; }
Term leaky_relu(In a) { return a[0] > 0 ? Term{a[0], 1} : Term{0.01 * a[0], 0.01}; }
Term limited(In a) { return std::abs(a[0]) <= 10 ? Term{a[0], 1} : Term{std::copysign(10, a[0]), 0}; }
Term sigmoid(In a) { return {1 / (1 + std::exp(-a[0])), 1 / (2 + std::exp(a[0]) + std::exp(-a[0]))}; }
Term product(In a) { return {a[0] * a[1], a[1], a[0]}; }

// ---- 2. Tensors: an array [c][h][w] and its gradient. Signals have h = 1, vectors h = w = 1.
using Array = std::vector<double>;
struct Shape {
  int c, h = 1, w = 1;
  int size() const { return c * h * w; }
};
struct Node : Shape {
  Array value = Array(std::size_t(size())), grad = value, m = value, v = value;  // m, v: Adam's, of weights
};
using Tensor = std::shared_ptr<Node>;
Tensor tensor(Shape shape, const Array& values = {}) {
  auto x = std::make_shared<Node>(Node{shape});
  std::copy(values.begin(), values.end(), x->value.begin());
  return x;
}
const Tensor one = tensor({1}, {1});

// ---- 3. The chain rule: the reverse steps of the ops, in their order. A step runs when the gradient of its
// result is complete, and adds to those of what that was made from: a value used twice has two of them.
std::vector<std::function<void()>> tape;
void backward(const Tensor& loss) {
  loss->grad[0] = 1;
  for (auto step = tape.rbegin(); step != tape.rend(); ++step) (*step)();
  tape.clear();
}
// Most ops meet elements one by one: a term of the i-th element of each input. Smaller inputs are repeated,
// and terms of smaller results are added up: a gate serves all pixels of its channel, a loss is one number.
template <class F>
Tensor each(Shape shape, const std::vector<Tensor>& xs, F term) {
  int n = shape.size();
  for (const Tensor& x : xs) n = std::max(n, x->size());
  const auto term_of = [=](int i) {
    double a[5];
    for (std::size_t k = 0; k < xs.size(); ++k) a[k] = xs[k]->value[i / (n / xs[k]->size())];
    return term(a);
  };
  const Tensor y = tensor(shape);
  for (int i = 0; i < n; ++i) y->value[i / (n / y->size())] += term_of(i)[0];
  tape.push_back([=] {
    for (int i = 0; i < n; ++i) {
      const Term t = term_of(i);
      const double g = y->grad[i / (n / y->size())];
      for (std::size_t k = 0; k < xs.size(); ++k) xs[k]->grad[i / (n / xs[k]->size())] += g * t[k + 1];
    }
  });
  return y;
}
Tensor add(const Tensor& x, double k, const Tensor& y) {  // x + k y
  return each(*x, {x, y}, [k](In a) { return Term{a[0] + k * a[1], 1, k}; });
}

// ---- 4. Products: y[c] += w[a] x[b] for each {a, b, c}. Linear layers and convolutions consist of them.
using Products = std::vector<std::array<int, 3>>;
Tensor bilinear(Shape shape, const Tensor& w, const Tensor& x, const Products& products) {
  const Tensor y = tensor(shape);
  for (const auto& [a, b, c] : products) y->value[c] += w->value[a] * x->value[b];
  tape.push_back([=, &products] {
    for (const auto& [a, b, c] : products) {
      x->grad[b] += w->value[a] * y->grad[c];
      w->grad[a] += x->value[b] * y->grad[c];
    }
  });
  return y;
}

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
      const int row = x->h == 1 ? 0 : q / coarse.w * k.stride + tap / k.size - k.pad;
      const int column = q % coarse.w * k.stride + tap % k.size - k.pad, p = row * fine.w + column;
      if (row < 0 || row >= fine.h || column < 0 || column >= fine.w) continue;  // in the padding
      products.push_back({k.up ? (i * outputs + o) * taps + tap : at, i * x->h * x->w + (k.up ? q : p),
                          o * y.h * y.w + (k.up ? p : q)});
    }
  }
  return bilinear(y, w, x, products);
}

// ---- 6. Channel attention: each channel is looked at by its mean, and weighed.
Term gated(In a) { return {a[0] + a[1] * a[2], 1, a[2], a[1]}; }
Tensor channel_mean(const Tensor& x) {
  return add(tensor({x->c}), 1. / (x->h * x->w), each({x->c}, {x}, same));
}

// ---- 7. Of a = mean, log_var, eps: a sample of N(mean, exp(log_var)), and how far that is from N(0, 1).
Term sample(In a) { return {a[0] + std::exp(a[1] / 2) * a[2], 1, std::exp(a[1] / 2) * a[2] / 2}; }
Term kld(In a) { return {(a[0] * a[0] + std::exp(a[1]) - 1 - a[1]) / 2, a[0], std::exp(a[1]) / 2 - .5}; }

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
    const double s = n1 * n2 / (d1 * d2), by_var = -s / d2, by_cov = 2 * n1 / (d1 * d2);
    const double by_mean = 2 * (a[1] * n2 / (d1 * d2) - a[0] * s / d1 - a[0] * by_var) - a[1] * by_cov;
    return Term{s, by_mean, 0, by_var, 0, by_cov};  // y is the truth: nobody asks for its slopes
  };
  const Tensor mx = blur(x, one), my = blur(y, one);
  return add(tensor({1}), 1. / mx->size(), each({1}, {mx, my, blur(x, x), blur(y, y), blur(x, y)}, term));
}
Term squared_difference(In a) { return {std::pow(a[0] - a[1], 2), 2 * (a[0] - a[1]), 2 * (a[1] - a[0])}; }

// ---- 9. Adam (Kingma & Ba 2015), of one tensor whose gradient is multiplied by `clip`, then forgotten.
void adam(Node& w, double clip, double rate, int step) {
  for (int i = 0; i < w.size(); ++i) {
    const double g = clip * w.grad[i];
    w.m[i] += 0.1 * (g - w.m[i]), w.v[i] += 0.001 * (g * g - w.v[i]), w.grad[i] = 0;
    const double m = w.m[i] / (1 - std::pow(0.9, step)), v = w.v[i] / (1 - std::pow(0.999, step));
    w.value[i] -= rate * m / (std::sqrt(v) + 1e-8);
  }
}

// ---- 10. The weights by their names in a checkpoint: made when first asked for, within 1 / sqrt(fan_in).
std::map<std::string, Tensor> weights;
std::mt19937_64 bits(1);
double uniform() { return double(bits() >> 11) * 0x1p-53; }
double normal() { return std::sqrt(-2 * std::log(1 - uniform())) * std::cos(2 * M_PI * uniform()); }
Tensor weight(const std::string& name, int size, double fan_in) {
  Tensor& w = weights[name];
  if (!w)
    for (double& at : (w = tensor({size}))->value) at = (2 * uniform() - 1) / std::sqrt(fan_in);
  if (w->size() != size) throw std::runtime_error(name + ": the file has another size");
  return w;
}
Tensor layer(const std::string& name, const Tensor& x, int outputs, Kernel k, Term (*f)(In) = same) {
  const int taps = (x->h == 1 ? 1 : k.size) * k.size, fan_in = (k.up ? outputs : x->c) * taps;
  const Tensor y = convolve(name, weight(name + ".weight", outputs * x->c * taps, fan_in), x, outputs, k);
  return each(*y, {add(y, 1, weight(name + ".bias", outputs, fan_in))}, f);
}
// A safetensors file: 8 bytes, the length of a JSON object that says where tensors lie, and their bytes.
void load(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string all((std::istreambuf_iterator<char>(file)), {}), key = "\"data_offsets\":[";
  std::size_t length = 0, first = 0, last = 0;
  if (all.size() >= 8) std::copy_n(all.data(), 8, reinterpret_cast<char*>(&length));
  if (length == 0 || length > all.size() - 8) throw std::runtime_error(path + ": no safetensors file");
  const std::string header = all.substr(8, length), data = all.substr(8 + length);
  for (std::size_t at = header.find(key); at != std::string::npos; at = header.find(key, at + 1)) {
    const auto end = header.rfind("\":{", at), start = header.rfind('"', end - 1) + 1;
    std::sscanf(header.c_str() + at + key.size(), "%zu,%zu", &first, &last);
    if (last < first || last > data.size()) throw std::runtime_error(path + ": it is cut off");
    std::vector<float> v((last - first) / sizeof(float));
    std::copy_n(&data[first], v.size() * sizeof(float), reinterpret_cast<char*>(v.data()));
    weights[header.substr(start, end - start)] = tensor({int(v.size())}, Array(v.begin(), v.end()));
  }
}

// ---- 11. The network: four autoencoders, one for each row of taxels, and an upsampler of what they know.
constexpr int kSide = 4, kTime = 128, kLatent = 10, kMaps = 8;
struct Example {
  Array window[kSide], eps[kSide];  // of a row of taxels: [taxel][time], 1: pressed; for sample()
  Array truth;                      // [16][16], 1: the plate's highest point
};
struct Drawn {
  Tensor picture, error, loss;  // the error that is expected of each pixel; what training makes smaller
};
Tensor attended(const std::string& name, const Tensor& x) {  // RCAB: a block with channel attention
  const Tensor h = layer(name + "conv.1", layer(name + "conv.0", x, kMaps, kSame, relu), kMaps, kSame);
  const Tensor s = layer(name + "attention.squeeze", channel_mean(h), kMaps / 4, kOne, relu);
  return each(*x, {x, h, layer(name + "attention.expand", s, kMaps, kOne, sigmoid)}, gated);
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
  for (const Example& e : batch) {
    const Tensor l = draw(e).loss;
    loss += l->value[0] / n;
    backward(l);
  }
  for (auto& [name, w] : weights)
    for (double& g : w->grad) g /= n, squares += g * g;
  const double clip = std::min(1.0, 1 / std::sqrt(squares)), rate = 2e-3 * std::min(1.0, step / 50.0);
  for (auto& [name, w] : weights) adam(*w, clip, rate, step);
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
