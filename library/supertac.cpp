#include "library/supertac.h"

#include <omp.h>
#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "data/map/surface_map.h"
#include "data/windows/live_window.h"
#include "data/windows/transforms.h"
#include "data/windows/windows.h"
#include "io/numbers/numbers.h"
#include "library/guard.h"
#include "models/files/model_file.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/training/train.h"

using namespace supertac;
using c::expect, c::expect_within, c::guarded;

struct supertac_model {
  ModelFile file;
  Ensemble network;  // of this one
};

struct supertac_pairs {
  WindowSet windows;
};

struct supertac_map {
  const supertac_model* model;
  SurfaceMap surface;
};

struct supertac_live {
  const supertac_model* model;
  LiveWindow window;
  Tensor input;
};

namespace {

constexpr std::size_t kBatch = 32;  // windows that a thread draws at once

thread_local std::string last_error;

// The threads that OpenMP keeps for a thread do not survive its fork, and who waits for them waits for ever:
// what was that thread goes on alone, to the same bits.
thread_local bool alone = false;
[[maybe_unused]] const int at_fork = pthread_atfork(nullptr, nullptr, [] {
  alone = true;
  omp_set_num_threads(1);
});

supertac_model* opened(ModelFile file, int precision) {
  if (precision != SUPERTAC_FP32 && precision != SUPERTAC_INT8)
    refuse("supertac_open", "precision", "SUPERTAC_FP32 or SUPERTAC_INT8", std::to_string(precision));
  Ensemble network = ensemble_of({&file, 1}, precision == SUPERTAC_INT8 ? Precision::int8 : Precision::fp32);
  return new supertac_model{std::move(file), std::move(network)};
}

// Windows in the sensor's unit to what the network takes.
void scale(const ModelFile& file, std::span<float> windows) {
  file.input.scaling(windows);
  expect(std::ranges::none_of(windows, [](float v) { return std::isnan(v); }),
         "supertac_draw: a window has a value that is NaN");
  if (!file.input.scaling.per_window) return;
  const auto size = static_cast<std::size_t>(file.model->input_shape(1).elements());
  for (; !windows.empty(); windows = windows.subspan(size))
    normalise_window(windows.first(size), file.array().signals());
}

void draw(const supertac_model& model, const Tensor& inputs, float* pictures, float* predicted_errors) {
  const Estimate drawn = model.network.estimate(inputs);
  expect(predicted_errors == nullptr || drawn.predicted_error.size() > 0,
         "predicted errors expect a model that predicts them, got one that does not");
  std::copy_n(drawn.picture.data(), drawn.picture.size(), pictures);
  if (predicted_errors != nullptr)
    std::copy_n(drawn.predicted_error.data(), drawn.predicted_error.size(), predicted_errors);
}

}  // namespace

// Of an error that leaves no memory for its words the short ones remain, which take none.
void c::keep(const char* text) noexcept {
  try {
    last_error = text;
  } catch (...) {
    last_error.assign("no memory");
  }
}

void c::expect_within(const char* what, double found, double least, double most) {
  if (found >= least && found <= most) return;
  throw std::invalid_argument(std::string(what) + " expects " + format(least) + " to " + format(most) +
                              ", got " + format(found));
}

const char* supertac_version(void) { return SUPERTAC_VERSION; }

const char* supertac_error(void) { return last_error.c_str(); }

supertac_model* supertac_open(const char* path, int precision) {
  return guarded(__func__, {path}, [&] { return opened(load_model(path), precision); });
}

supertac_model* supertac_open_memory(const void* bytes, std::size_t size, int precision) {
  return guarded(__func__, {bytes}, [&] {
    const std::span file(static_cast<const std::byte*>(bytes), size);
    return opened(model_of(SafetensorsFile::of(file, "model in memory")), precision);
  });
}

void supertac_close(supertac_model* model) { delete model; }

int supertac_describe(const supertac_model* model, supertac_description* description) {
  return guarded(__func__, {model, description}, [&] {
    const SuperTacSettings& s = model->file.model->settings();
    const InputSettings& input = model->file.input;
    const Pitch pixel = input.pitch_mm / static_cast<double>(s.scale);
    return c::describe(description, supertac_description{.size = 0,
                                                         .rows = static_cast<int>(s.rows),
                                                         .columns = static_cast<int>(s.columns),
                                                         .channels = static_cast<int>(s.in_channels),
                                                         .signals = static_cast<int>(s.signals()),
                                                         .timesteps = static_cast<int>(s.timesteps),
                                                         .height = static_cast<int>(s.image_height()),
                                                         .width = static_cast<int>(s.image_width()),
                                                         .predicts_error = s.predicted_error ? 1 : 0,
                                                         .rate_hz = input.rate_hz,
                                                         .pitch_mm = {input.pitch_mm.x, input.pitch_mm.y},
                                                         .pixel_mm = {pixel.x, pixel.y},
                                                         .filter_s = input.filter_s.value_or(-1),
                                                         .rest = input.scaling.rest,
                                                         .span = input.scaling.span,
                                                         .delay_s = input.delay_s});
  });
}

int supertac_draw(const supertac_model* model, std::size_t count, const float* windows, float* pictures,
                  float* predicted_errors, int threads) {
  return guarded(__func__, {model}, [&] {
    expect(count == 0 || (windows != nullptr && pictures != nullptr),
           "supertac_draw: windows or pictures is NULL");
    expect_within("supertac_draw: threads", threads, 1, 1024);
    const SuperTac& network = *model->file.model;
    const auto window = static_cast<std::size_t>(network.input_shape(1).elements());
    const auto picture = static_cast<std::size_t>(network.picture_shape(1).elements());
    if (count > std::numeric_limits<std::size_t>::max() / sizeof(float) / std::max(window, picture))
      refuse("supertac_draw", "count", "no more windows than memory can hold", std::to_string(count));
    const auto batches = static_cast<std::int64_t>((count + kBatch - 1) / kBatch);
    if (alone) threads = 1;
    std::exception_ptr failure;
#pragma omp parallel for schedule(dynamic) num_threads(threads) if (threads > 1 && batches > 1)
    for (std::int64_t batch = 0; batch < batches; ++batch) {
      try {
        const std::size_t first = static_cast<std::size_t>(batch) * kBatch,
                          n = std::min(kBatch, count - first);
        Tensor input(network.input_shape(static_cast<Dim>(n)));
        std::copy_n(windows + first * window, n * window, input.data());
        scale(model->file, input.values());
        draw(*model, input, pictures + first * picture,
             predicted_errors == nullptr ? nullptr : predicted_errors + first * picture);
      } catch (...) {
#pragma omp critical
        failure = std::current_exception();
      }
    }
    if (failure) std::rethrow_exception(failure);
    return 0;
  });
}

supertac_live* supertac_live_new(const supertac_model* model, double frame_hz, double filter_s) {
  return guarded(__func__, {model}, [&] {
    expect_within("supertac_live_new: frame_hz", frame_hz, 1, 100'000);
    expect_within("supertac_live_new: filter_s", filter_s, 0, 10);
    const InputSettings& input = model->file.input;
    const std::optional<double> left_s = input.filter_left(filter_s);
    expect(left_s.has_value(),
           "supertac_live_new: the frames have gone through another moving average than the model's training "
           "signals; give it frames without");
    return new supertac_live{
        model,
        LiveWindow({.timesteps = static_cast<int>(model->file.model->settings().timesteps),
                    .signals = model->file.array().signals(),
                    .rate_hz = input.rate_hz,
                    .scaling = input.scaling,
                    .filter_s = *left_s,
                    .frame_period_s = 1 / frame_hz}),
        Tensor(model->file.model->input_shape(1))};
  });
}

void supertac_live_free(supertac_live* live) { delete live; }

int supertac_live_push(supertac_live* live, double time_s, const float* frame) {
  return guarded(__func__, {live, frame}, [&] {
    live->window.push(time_s, std::span(frame, live->model->file.array().signals()));
    return 0;
  });
}

int supertac_live_picture(supertac_live* live, float* picture, float* predicted_error) {
  return guarded(__func__, {live, picture}, [&] {
    if (!live->window.window(live->input.values())) return 0;
    draw(*live->model, live->input, picture, predicted_error);
    return 1;
  });
}

supertac_map* supertac_map_new(const supertac_model* model) {
  return guarded(__func__, {model}, [&] {
    const WindowSettings windows = model->file.windows();
    return new supertac_map{model,
                            SurfaceMap(model->file.array().picture(windows.scale), windows.timesteps > 1)};
  });
}

void supertac_map_free(supertac_map* map) { delete map; }

int supertac_map_add(supertac_map* map, double x_mm, double y_mm, const float* picture,
                     const float* predicted_error) {
  return guarded(__func__, {map, picture}, [&] {
    const std::size_t pixels = map->surface.grid().pixels();
    map->surface.add(x_mm, y_mm, std::span(picture, pixels),
                     std::span(predicted_error, predicted_error != nullptr ? pixels : 0));
    return 0;
  });
}

int supertac_map_cells(const supertac_map* map, int* height, int* width, double corner_mm[2], float* values,
                       float* errors) {
  return guarded(__func__, {map, height, width, corner_mm}, [&] {
    const MapRegion& felt = map->surface.felt();
    const Pitch cell = map->surface.grid().pixel_mm;
    *height = static_cast<int>(felt.height), *width = static_cast<int>(felt.width);
    corner_mm[0] = static_cast<double>(felt.left) * cell.x;
    corner_mm[1] = static_cast<double>(felt.bottom) * cell.y;
    if (values == nullptr && errors == nullptr) return 0;
    MapCells cells = map->surface.cells(felt);
    if (values != nullptr) std::ranges::copy(cells.values, values);
    if (errors == nullptr) return 0;
    std::fill_n(errors, cells.values.size(), std::numeric_limits<float>::quiet_NaN());
    map->model->file.interval().half_widths(cells.values, felt.width, cells.errors, cells.errors);
    std::ranges::copy(cells.errors, errors);
    return 0;
  });
}

supertac_pairs* supertac_pairs_open(const supertac_model* model, const char* recordings, long long stride) {
  return guarded(__func__, {model, recordings}, [&] {
    expect_within("supertac_pairs_open: stride", static_cast<double>(stride), 1, 1e6);
    WindowSettings settings = model->file.windows();
    settings.stride = static_cast<int>(stride);
    return new supertac_pairs{WindowSet::load(recordings, {}, settings)};
  });
}

void supertac_pairs_close(supertac_pairs* pairs) { delete pairs; }

std::size_t supertac_pairs_count(const supertac_pairs* pairs) {
  return pairs == nullptr ? 0 : pairs->windows.size();
}

int supertac_pairs_read(const supertac_pairs* pairs, std::size_t first, std::size_t count, float* windows,
                        float* truths) {
  return guarded(__func__, {pairs, windows, truths}, [&] {
    const WindowSet& all = pairs->windows;
    expect_within("supertac_pairs_read: first", static_cast<double>(first), 0,
                  static_cast<double>(all.size()));
    expect_within("supertac_pairs_read: count", static_cast<double>(count), 0,
                  static_cast<double>(all.size() - first));
    const std::size_t pixels = all.image().pixels();
    for (std::size_t i = 0; i < count; ++i) {
      all.window(first + i, std::span(windows + i * all.input_size(), all.input_size()));
      all.truth(first + i, std::span(truths + i * pixels, pixels));
    }
    return 0;
  });
}

int supertac_train(const char* recipe, const char* recordings, const char* out,
                   const supertac_training* settings, supertac_progress progress, void* user) {
  return guarded(__func__, {recipe, recordings, out}, [&] {
    Recipe wanted = Recipe::named(recipe);
    if (settings != nullptr) {
      if (settings->size != sizeof(supertac_training))
        refuse("supertac_train", "settings.size", "sizeof(supertac_training)",
               std::to_string(settings->size));
      if (settings->epochs != 0) wanted.epochs = settings->epochs;
      if (settings->stride != 0) wanted.stride = settings->stride;
      if (settings->split != nullptr) wanted.split = split_kind(settings->split);
      wanted.seed = settings->seed;
    }
    bool stop = false;
    TrainingCallbacks callbacks;
    callbacks.stop = [&] { return stop; };
    if (progress != nullptr)
      callbacks.step = [&](const StepReport& step) { stop = progress(user, step.step, step.total) != 0; };
    return train(wanted, recordings, out, callbacks) ? 1 : 0;
  });
}
