// One picture from a checkpoint and the last samples of a sensor: what a program that embeds SuperTac does.
// It takes 0.02 s, files included; the network itself needs 0.16 ms of them.
//
//   load_and_draw MODEL RECORDING SECONDS PICTURE.png
//
// The frames of a recording are pushed one by one, as a driver would push them. The picture shows what the
// array feels at SECONDS on its left, and what the network draws from the samples up to then on its right.
#include <cstdio>
#include <exception>
#include <span>
#include <stdexcept>
#include <string>

#include <supertac/data/recordings/recording.h>
#include <supertac/data/windows/live_window.h>
#include <supertac/io/images/images.h>
#include <supertac/models/files/model_file.h>

using namespace supertac;

namespace {

// The samples before `seconds`, filtered, resampled and scaled as the model's training was: [1,T,signals].
Tensor window_at(const ModelFile& file, const Recording& recording, double seconds) {
  const SuperTacSettings& settings = file.model->settings();
  const std::optional<double> filter_s = file.input.filter_left(recording.filter_s());
  if (!filter_s)
    throw std::runtime_error("the recording's signals were filtered otherwise than the training's");
  LiveWindow live({.timesteps = static_cast<int>(settings.timesteps),
                   .signals = recording.array.signals(),
                   .rate_hz = file.input.rate_hz,
                   .scaling = file.input.scaling,
                   .filter_s = *filter_s,
                   .frame_period_s = (recording.time_s.back() - recording.time_s.front()) /
                                     static_cast<double>(recording.frames() - 1)});
  for (std::size_t i = 0; i < recording.frames() && recording.time_s[i] <= seconds; ++i)
    live.push(recording.time_s[i],
              std::span(recording.signals).subspan(i * recording.array.signals(), recording.array.signals()));
  Tensor window(Shape{1, settings.timesteps, settings.signals()});
  if (!live.window(window.values()))
    throw std::runtime_error("too few frames before " + std::to_string(seconds) + " s: a picture needs " +
                             std::to_string(static_cast<double>(settings.timesteps) / file.input.rate_hz) +
                             " s");
  return window;
}

void draw(const std::string& path, const Tensor& window, const Tensor& image, const SuperTacSettings& s) {
  constexpr int kSide = 256, kGap = 16;
  Picture picture(2 * kSide + 3 * kGap, kSide + 2 * kGap);
  const std::span<const float> newest = window.values().last(static_cast<std::size_t>(s.signals()));
  draw_panel(picture, {kGap, kGap, kSide, kSide}, newest, static_cast<int>(s.rows),
             static_cast<int>(s.columns));
  draw_panel(picture, {kSide + 2 * kGap, kGap, kSide, kSide}, image.values(),
             static_cast<int>(s.image_height()), static_cast<int>(s.image_width()));
  write_png(path, picture);
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 5) throw std::invalid_argument("expects MODEL RECORDING SECONDS PICTURE.png");
  const ModelFile file = load_model(argv[1]);
  const Recording recording = read_recording(argv[2]);
  if (recording.array != file.array() || recording.array.channels != 1)
    throw std::invalid_argument("the recording is of " + recording.array.text() + ", the model of " +
                                file.array().text() + "; this example draws one number a taxel");
  const Tensor window = window_at(file, recording, std::stod(argv[3]));
  const Tensor image = file.model->infer(window);
  draw(argv[4], window, image, file.model->settings());
  std::printf("%s: %s, %lld samples of %s\n", argv[4], image.shape().text().c_str(),
              static_cast<long long>(window.dim(1)), file.array().text().c_str());
} catch (const std::exception& e) {
  std::fprintf(stderr, "load_and_draw: %s\n", e.what());
  return 1;
}
