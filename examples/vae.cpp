// A variational auto-encoder (Kingma & Welling 2014) with its data, its training and a picture at the end.
// In 1,500 steps the squared error of a pixel falls to 0.0014 on pictures never seen, in 4 s on one thread.
//   vae [PICTURE.png]      The picture's rows: domes never trained on, the same through four latent numbers,
//                          and what the decoder makes of random latent numbers.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <vector>

#include <supertac/autograd/ops/arithmetic.h>
#include <supertac/autograd/ops/losses.h>
#include <supertac/autograd/ops/shaping.h>
#include <supertac/autograd/ops/vae.h>
#include <supertac/autograd/optimisers/adam.h>
#include <supertac/io/images/images.h>
#include <supertac/layers/convolution.h>
#include <supertac/layers/linear.h>

using namespace supertac;

namespace {

constexpr Dim kSide = 16, kLatent = 4, kCoarse = kSide / 4, kMaps = 32;
constexpr real kBeta = real(1e-3);  // of the divergence, against the squared error of a pixel
constexpr ConvLayerOptions kHalve{.kernel = 3, .stride = 2, .padding = 1},
    kDouble{.kernel = 4, .stride = 2, .padding = 1};

class Vae : public Module {
 public:
  explicit Vae(Rng& rng)
      : halve1_(add("halve1", Conv2d(1, 16, kHalve, rng))),
        halve2_(add("halve2", Conv2d(16, kMaps, kHalve, rng))),
        mean_(add("mean", Linear(kMaps * kCoarse * kCoarse, kLatent, rng))),
        log_var_(add("log_var", Linear(kMaps * kCoarse * kCoarse, kLatent, rng))),
        unfold_(add("unfold", Linear(kLatent, kMaps * kCoarse * kCoarse, rng))),
        double1_(add("double1", ConvTranspose2d(kMaps, 16, kDouble, rng))),
        double2_(add("double2", ConvTranspose2d(16, 1, kDouble, rng))) {}

  struct Output {
    Variable mean, log_var, picture;  // [N,4], [N,4], [N,16,16,1]
  };
  // x [N,16,16,1], eps [N,4] ~ N(0,1): z = mean + exp(log_var / 2) eps
  Output forward(const Variable& x, const Tensor& eps) const {
    const Variable h = halve2_.forward(halve1_.forward(x, kLeakyRelu), kLeakyRelu);  // [N,8,8,16], [N,4,4,32]
    const Variable flat = flatten_channels_first(h);                                 // [N,512]
    Output out{mean_.forward(flat), clamp(log_var_.forward(flat), -10, 10), {}};
    out.picture = decode(sample_gaussian(out.mean, out.log_var, eps));
    return out;
  }
  Variable decode(const Variable& z) const {
    const Dim pixels[] = {kCoarse, kCoarse};
    const Variable h = unflatten_channels_first(unfold_.forward(z, kLeakyRelu), pixels);  // [N,4,4,32]
    return sigmoid(double2_.forward(double1_.forward(h, kLeakyRelu)));                    // [N,16,16,1]
  }

 private:
  Conv2d halve1_, halve2_;
  Linear mean_, log_var_, unfold_;
  ConvTranspose2d double1_, double2_;
};

// n pictures of the stream, from the number `first` on: 1 at the dome's top, 0 beside it.
Tensor domes(const RandomStream& random, std::uint64_t first, Dim n) {
  Tensor pictures(Shape{n, kSide, kSide, 1});
  real* pixel = pictures.data();
  for (std::uint64_t i = first; i < first + static_cast<std::uint64_t>(n); ++i) {
    const double x = 3 + 10 * random.uniform(3 * i), y = 3 + 10 * random.uniform(3 * i + 1);
    const double radius = 2 + 3 * random.uniform(3 * i + 2);
    for (Dim r = 0; r < kSide; ++r)
      for (Dim c = 0; c < kSide; ++c) {
        const double distance = std::hypot(static_cast<double>(c) - x, static_cast<double>(r) - y) / radius;
        *pixel++ = static_cast<real>(std::sqrt(std::max(0.0, 1 - distance * distance)));
      }
  }
  return pictures;
}

Tensor normal(const RandomStream& random, std::uint64_t first, Dim n) {
  Tensor eps(Shape{n, kLatent});
  for (real& e : eps.values()) e = static_cast<real>(random.normal(first++));
  return eps;
}

// One column for each picture: it, its reconstruction, and one that was dreamt up.
void draw(const char* path, const Tensor& shown, const Tensor& decoded, const Tensor& dreamt) {
  constexpr std::size_t kPixels = kSide * kSide;
  std::vector<PanelValues> panels;
  for (const Tensor* row : {&shown, &decoded, &dreamt})
    for (std::size_t at = 0; at < row->values().size(); at += kPixels)
      panels.push_back({row->values().subspan(at, kPixels), kSide, kSide});
  write_png(path, panel_grid(panels, static_cast<int>(shown.dim(0)), 64));
}

void train_and_draw(const char* path) {
  constexpr int kBatch = 64, kSteps = 1500, kShown = 12;
  const RandomStream data(1, 0), noise(1, 1), unseen(2, 0), dreams(2, 1);
  Rng rng(0);
  const Vae vae(rng);
  Adam adam(values_of(vae.parameters()), {.clip_norm = 1});
  const Schedule schedule{.peak = 4e-3, .warm_up = 50, .total = kSteps};
  for (int step = 0; step < kSteps; ++step) {
    const auto first = static_cast<std::uint64_t>(step * kBatch);
    const Variable x(domes(data, first, kBatch));
    const Vae::Output out = vae.forward(x, normal(noise, first * kLatent, kBatch));
    const Variable error = l2_loss(out.picture, x), kld = kl_divergence(out.mean, out.log_var);
    if ((step + 1) % 250 == 0)
      std::printf("step %4d  squared error %.5f  KLD %.2f\n", step + 1, error.item(), kld.item());
    adam.zero_grad();
    backward(error + kBeta * kld);
    adam.set_learning_rate(schedule.at(step));
    adam.step();
  }
  const NoGrad only_values;
  const Tensor shown = domes(unseen, 0, kShown);
  const Variable decoded = vae.forward(Variable(shown), Tensor::zeros({kShown, kLatent})).picture;
  draw(path, shown, decoded.value(), vae.decode(Variable(normal(dreams, 0, kShown))).value());
  std::printf("12 pictures never seen: squared error %.5f; %s\n", l2_loss(decoded, Variable(shown)).item(),
              path);
}

}  // namespace

int main(int argc, char** argv) try {
  train_and_draw(argc > 1 ? argv[1] : "vae.png");
} catch (const std::exception& e) {
  std::fprintf(stderr, "vae: %s\n", e.what());
  return 1;
}
