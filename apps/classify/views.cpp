#include "apps/classify/views.h"

#include <algorithm>
#include <stdexcept>

#include "data/scores/baselines.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr Dim kSteps = 16;  // of a history
constexpr const char* kHistory = "history";

constexpr struct {
  const char* name;
  ViewKind kind;
} kNames[] = {{"frame", ViewKind::frame},
              {"bicubic", ViewKind::bicubic},
              {"super_resolved", ViewKind::super_resolved},
              {"latents", ViewKind::latents},
              {"truth", ViewKind::truth}};

Tensor last_frames(const Tensor& windows, const TaxelArray& array) {
  constexpr int kSmallest = 4;  // that a classifier of pictures takes
  const Dim count = windows.dim(0), signals = windows.dim(2), stride = windows.dim(1) * signals;
  Tensor frames = std::min(array.rows, array.columns) < kSmallest
                      ? Tensor(Shape{count, signals})
                      : Tensor(Shape{count, array.rows, array.columns, array.channels});
  for (Dim n = 0; n < count; ++n)
    std::copy_n(windows.data() + (n + 1) * stride - signals, signals, frames.data() + n * signals);
  return frames;
}

Tensor enlarged(const Tensor& windows, const WindowSet& data) {
  const ImageGrid image = data.image();
  const TaxelArray array = data.array();
  const Upsampling bicubic(Upsampling::Kind::bicubic, array.rows, array.columns, data.settings().scale);
  const auto count = static_cast<std::size_t>(windows.dim(0));
  const std::size_t values = windows.values().size() / count;
  Tensor pictures(Shape{windows.dim(0), image.height, image.width, 1});
  for (std::size_t n = 0; n < count; ++n) {
    const auto frame = windows.values().subspan(n * values, values).last(array.signals());
    bicubic(mean_of_channels(array, frame), pictures.values().subspan(n * image.pixels(), image.pixels()));
  }
  return pictures;
}

Tensor history(const Tensor& windows, Dim frames) {
  if (frames > windows.dim(1)) {
    throw std::invalid_argument("a history of " + std::to_string(frames) + " frames is longer than the " +
                                std::to_string(windows.dim(1)) + " of the model's windows");
  }
  const Dim count = windows.dim(0), signals = windows.dim(2), per_step = frames / kSteps;
  Tensor pictures = Tensor::zeros(Shape{count, kSteps, signals, 1});
  for (Dim n = 0; n < count; ++n) {
    const real* from = windows.data() + ((n + 1) * windows.dim(1) - frames) * signals;
    real* to = pictures.data() + n * kSteps * signals;
    for (Dim t = 0; t < frames; ++t, from += signals) {
      real* step = to + t / per_step * signals;
      for (Dim k = 0; k < signals; ++k) step[k] += from[k] / static_cast<real>(per_step);
    }
  }
  return pictures;
}

Tensor truths(const WindowSet& data, std::span<const std::uint32_t> indices) {
  const ImageGrid image = data.image();
  Tensor pictures(Shape{static_cast<Dim>(indices.size()), image.height, image.width, 1});
  const std::size_t pixels = image.pixels();
  for (std::size_t n = 0; n < indices.size(); ++n) {
    data.truth(indices[n], pictures.values().subspan(n * pixels, pixels));
  }
  return pictures;
}

}  // namespace

std::string View::name() const {
  if (kind == ViewKind::history) return kHistory + std::to_string(frames);
  return std::find_if(std::begin(kNames), std::end(kNames), [&](const auto& n) { return n.kind == kind; })
      ->name;
}

View View::named(const std::string& name) {
  for (const auto& known : kNames) {
    if (name == known.name) return {known.kind};
  }
  if (name.starts_with(kHistory)) {
    const auto frames = parse_int(name.substr(std::string(kHistory).size()));
    if (frames && *frames >= kSteps && *frames <= 512 && *frames % kSteps == 0) {
      return {ViewKind::history, static_cast<int>(*frames)};
    }
  }
  throw std::invalid_argument("unknown view \"" + name +
                              "\"; known: frame, bicubic, super_resolved, latents, truth, historyN with N a "
                              "multiple of 16 frames, 16 to 512");
}

Tensor show(const View& view, const SuperTac& model, const WindowSet& data,
            std::span<const std::uint32_t> indices, const Tensor& windows) {
  switch (view.kind) {
    case ViewKind::frame:
      return last_frames(windows, data.array());
    case ViewKind::bicubic:
      return enlarged(windows, data);
    case ViewKind::super_resolved:
      return model.infer(windows);
    case ViewKind::latents:
      return model.encode(windows);
    case ViewKind::history:
      return history(windows, view.frames);
    case ViewKind::truth:
      return truths(data, indices);
  }
  throw std::invalid_argument("show: no such view");
}

}  // namespace supertac
