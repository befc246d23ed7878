// The convolution and linear kernels at the shapes of preset `paper` (T 256, LD 10, x4), batch 1 and 64:
// forward, gradient of the input, gradient of the weights.
//
// GFLOP/s and share count the usual way, padding as if it were data: kernels that skip the padding, and
// Winograd's way by up to four times, can exceed the peak.
//
// `yardstick` is the share of the peak that OpenBLAS's cblas_sgemm reaches, on one thread, with the matrix
// product of that convolution: the picture's patches laid out as a matrix beforehand, which it is not
// charged.
#include <cblas.h>

#include "autograd/kernels/conv.h"

#include "autograd/kernels/fast/geometry.h"
#include "autograd/ops/linear.h"
#include "bench/against_peak.h"

namespace supertac {
namespace {

constexpr real kSlope = 0.01F;  // of the LeakyReLU that is stored with the sums

enum class Pass { forward, grad_x, grad_w };

struct Layer {
  const char* name;
  kernels::ConvSettings settings;
  Dim cin, cout;
};

constexpr kernels::ConvSettings conv2d(Dim size, Dim kernel) {
  return {.height = size,
          .width = size,
          .kernel_h = kernel,
          .kernel_w = kernel,
          .padding_h = kernel / 2,
          .padding_w = kernel / 2};
}
constexpr kernels::ConvSettings up2d(Dim size) {
  return {.height = size,
          .width = size,
          .kernel_h = 4,
          .kernel_w = 4,
          .stride_h = 2,
          .stride_w = 2,
          .padding_h = 1,
          .padding_w = 1,
          .transposed = true};
}
constexpr kernels::ConvSettings down1d(Dim length) {
  return {.width = length, .kernel_w = 3, .stride_w = 2, .padding_w = 1};
}
constexpr kernels::ConvSettings up1d(Dim length) {
  return {.width = length, .kernel_w = 4, .stride_w = 2, .padding_w = 1, .transposed = true};
}

const Layer kLayers[] = {
    {"conv3x3/4x4", conv2d(4, 3), 32, 32},
    {"conv3x3/8x8", conv2d(8, 3), 32, 32},
    {"conv3x3/16x16", conv2d(16, 3), 32, 32},
    {"up4x4s2/4x4", up2d(4), 32, 32},
    {"up4x4s2/8x8", up2d(8), 32, 32},
    {"picture/16x16", conv2d(16, 3), 32, 1},
    {"encoder.conv.0", down1d(256), 4, 16},
    {"encoder.conv.1", down1d(128), 16, 32},
    {"encoder.conv.2", down1d(64), 32, 32},
    {"encoder.conv.3", down1d(32), 32, 32},
    {"decoder.conv.0", up1d(16), 32, 32},
    {"decoder.conv.1", up1d(32), 32, 32},
    {"decoder.conv.2", up1d(64), 32, 16},
    {"decoder.conv.3", up1d(128), 16, 16},
    {"decoder.out", {.width = 256, .kernel_w = 3, .padding_w = 1}, 16, 4},
    {"encoder.fc", {}, 512, 64},
    {"encoder.mean", {}, 64, 10},
    {"decoder.fc.1", {}, 64, 512},
    {"upsampler.fc", {}, 40, 512},
    {"attention.squeeze", {}, 32, 8},
};

bool is_linear(const Layer& layer) { return layer.settings == kernels::ConvSettings{}; }

// Buffers of one layer at one batch size, and its three kernels. A linear layer is a convolution of one
// pixel.
struct Buffers {
  Buffers(const Layer& l, Dim batch)
      : layer(l),
        n(batch),
        geometry(kernels::geometry_of(l.settings)),
        x(Tensor::full({batch, geometry.in_pixels, l.cin}, 0.5F)),
        w(Tensor::full({geometry.taps, l.cin, l.cout}, 0.01F)),
        b(Tensor::zeros({l.cout})),
        y(Tensor::zeros({batch, geometry.out_pixels, l.cout})),
        gx(Tensor::zeros(x.shape())),
        gw(Tensor::zeros(w.shape())) {}

  void run(Pass pass) {
    const kernels::ConvSizes sizes{layer.settings, n, layer.cin, layer.cout};
    const Dim cin = layer.cin, cout = layer.cout;
    switch (pass) {
      case Pass::forward:
        return is_linear(layer)
                   ? kernels::linear(n, cin, cout, x.data(), w.data(), b.data(), kSlope, y.data())
                   : kernels::conv(sizes, x.data(), w.data(), b.data(), kSlope, y.data());
      case Pass::grad_x:
        return is_linear(layer)
                   ? kernels::linear_grad_x(n, cin, cout, y.data(), w.data(), Into::overwrite, gx.data())
                   : kernels::conv_grad_x(sizes, y.data(), w.data(), Into::overwrite, gx.data());
      case Pass::grad_w:
        return is_linear(layer)
                   ? kernels::linear_grad_w(n, cin, cout, x.data(), y.data(), Into::add, gw.data())
                   : kernels::conv_grad_w(sizes, x.data(), y.data(), Into::add, gw.data());
    }
  }

  Layer layer;
  Dim n;
  const kernels::Geometry& geometry;
  Tensor x, w, b, y, gx, gw;
};

// The product of matrices that a pass is once patches are rows: [pixels, patch] x [patch, channels] where a
// kernel gathers, [pixels, channels] x [channels, patch] where it scatters, and [patch, pixels] x
// [pixels, channels] for the weights.
class Product {
 public:
  Product(const Buffers& b, Pass pass) {
    const bool transposed = b.layer.settings.transposed;
    const int pixels = static_cast<int>(b.n * (transposed ? b.geometry.in_pixels : b.geometry.out_pixels));
    const int patch = static_cast<int>(b.geometry.taps * (transposed ? b.layer.cout : b.layer.cin));
    const int channels = static_cast<int>(transposed ? b.layer.cin : b.layer.cout);
    const bool gathers = (pass == Pass::forward) != transposed;
    weights_ = pass == Pass::grad_w;
    m_ = weights_ ? patch : pixels;
    n_ = weights_ || gathers ? channels : patch;
    k_ = weights_ ? pixels : gathers ? patch : channels;
    const auto floats = [](int rows, int columns, float value) {
      return std::vector<float>(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), value);
    };
    a_ = floats(m_, k_, 0.5F);
    b_ = floats(k_, n_, 0.01F);
    c_ = floats(m_, n_, 0);
  }

  void run() {
    cblas_sgemm(CblasRowMajor, weights_ ? CblasTrans : CblasNoTrans, CblasNoTrans, m_, n_, k_, 1, a_.data(),
                weights_ ? m_ : k_, b_.data(), n_, 0, c_.data(), n_);
  }

 private:
  bool weights_;
  int m_, n_, k_;
  std::vector<float> a_, b_, c_;
};

void run_kernel(benchmark::State& state, const Layer& layer, Pass pass) {
  Buffers buffers(layer, state.range(0));
  const kernels::Geometry& g = buffers.geometry;
  const auto pixels = static_cast<double>(layer.settings.transposed ? g.in_pixels : g.out_pixels);
  const double all = pixels * static_cast<double>(g.taps);
  const double channels = static_cast<double>(buffers.n * layer.cin * layer.cout);
  Product product(buffers, pass);
  openblas_set_num_threads(1);
  bench::run_against_peak(
      state, all * channels, [&] { buffers.run(pass); }, [&] { product.run(); });
}

const bool kRegistered = [] {
  constexpr std::pair<const char*, Pass> kPasses[] = {
      {"forward", Pass::forward}, {"grad_x", Pass::grad_x}, {"grad_w", Pass::grad_w}};
  for (const Layer& layer : kLayers) {
    for (const auto& [pass_name, pass] : kPasses) {
      const std::string name = std::string(layer.name) + "/" + pass_name;
      benchmark::RegisterBenchmark(
          name.c_str(), [&layer, pass = pass](benchmark::State& state) { run_kernel(state, layer, pass); })
          ->Arg(1)
          ->Arg(64)
          ->ArgName("batch")
          ->UseManualTime()
          ->MinTime(0.03)
          ->Unit(benchmark::kMicrosecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace supertac

BENCHMARK_MAIN();
