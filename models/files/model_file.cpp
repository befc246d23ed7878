#include "models/files/model_file.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/interval.h"
#include "models/inference/novelty.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

SuperTacSettings read_settings(JsonObject entry) {
  SuperTacSettings s;
  s.preset = entry.text("preset");
  if (entry.find("rows") != nullptr) {
    s.rows = entry.integer("rows");
    s.columns = entry.integer("columns");
    s.in_channels = entry.integer("in_channels");
  }
  s.timesteps = entry.integer("timesteps");
  s.latent = entry.integer("latent");
  s.scale = entry.integer("scale");
  s.channels = entry.integer("channels");
  s.rcabs = entry.integer("rcabs");
  s.predicted_error = entry.flag("spread", false);
  s.last_frame_path = entry.flag("last_frame_path", false);
  if (entry.flag("sub_pixel", false)) {
    throw std::runtime_error(
        entry.where() +
        ": expected transposed convolution, found \"sub_pixel\", which SuperTac no longer "
        "computes (22 % slower, no more accurate); train the model again");
  }
  try {
    s.grouping = grouping_of(entry.text("grouping"));
    s.check();
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(entry.where() + ": " + error.what());
  }
  return s;
}

InputSettings read_input(JsonObject entry) {
  const Json *filter = entry.find("filter_s"), *signals = entry.find("signals");
  const bool filtered = filter == nullptr || !filter->is_null();
  const InputSettings input{
      entry.number("rate_hz"),
      {entry.number("rest_volts"), entry.number("span_volts"), entry.flag("levelled", false)},
      filtered ? std::optional(entry.number("filter_s")) : std::nullopt,
      pitch_of(entry, InputSettings{}.pitch_mm),
      signals != nullptr ? scale_of({*signals, entry.where()}) : SignalScale{},
      entry.find("delay_s") != nullptr ? entry.number("delay_s") : 0};
  const double span = std::abs(input.scaling.span);
  if (input.rate_hz < 1 || input.rate_hz > 100'000 || std::abs(input.scaling.rest) > 2e9 || span <= 1e-6 ||
      span > 2e9 || input.filter_s.value_or(0) < 0 || input.filter_s.value_or(0) > 10 ||
      std::min(input.pitch_mm.x, input.pitch_mm.y) < 0.1 ||
      std::max(input.pitch_mm.x, input.pitch_mm.y) > 100 || input.delay_s < 0 || input.delay_s > 10) {
    throw std::runtime_error(
        entry.where() +
        ": expected rate_hz 1 to 100000, |rest_volts| <= 2e9, |span_volts| 1e-6 to 2e9, filter_s 0 to 10, "
        "pitch_mm 0.1 to 100, delay_s 0 to 10");
  }
  return input;
}

// Older versions trained networks of single frames on files of pairs.
void refuse_other_kinds(const SafetensorsFile& file) {
  const auto kind = file.metadata().find("kind");
  if (kind == file.metadata().end()) return;
  if (kind->second != "frame-checkpoint")
    throw std::runtime_error(file.path() + ": expected a model, found kind " + in_quotes(kind->second));
  throw std::runtime_error(
      file.path() +
      ": is a frame model of supertac-train --pairs, which is gone; turn its pairs into recordings "
      "(supertac-import FILE.safetensors --out DIR) and train again (supertac-train --data DIR --preset "
      "frame)");
}

std::unique_ptr<SuperTac> build(const SuperTacSettings& settings, const SafetensorsFile& file) {
  Rng rng = Rng::zeros();
  auto model = std::make_unique<SuperTac>(settings, rng);
  load_parameters(file, model->parameters(), {"optimizer.", "novelty.", "int8."});
  for (const Parameter& parameter : model->parameters())
    if (!std::ranges::all_of(parameter.value.value().values(), [](real v) { return std::isfinite(v); }))
      throw std::runtime_error(
          file.path() + ": " + in_quotes(parameter.name) +
          " holds NaN or infinity: its training diverged, or it is damaged; choose another model");
  return model;
}

}  // namespace

std::map<std::string, std::string> model_metadata(const SuperTacSettings& s, const InputSettings& input) {
  Json settings = {{"preset", s.preset}, {"timesteps", s.timesteps},        {"latent", s.latent},
                   {"scale", s.scale},   {"grouping", name_of(s.grouping)}, {"channels", s.channels},
                   {"rcabs", s.rcabs}};
  // What is as it always was is left out: the text of older files stays the same.
  if (s.predicted_error) settings["spread"] = true;
  if (s.last_frame_path) settings["last_frame_path"] = true;
  if (s.rows != 4 || s.columns != 4 || s.in_channels != 1) {
    settings["rows"] = s.rows;
    settings["columns"] = s.columns;
    settings["in_channels"] = s.in_channels;
  }
  Json scaling = {{"rate_hz", input.rate_hz},
                  {"rest_volts", input.scaling.rest},
                  {"span_volts", input.scaling.span},
                  {"filter_s", input.filter_s ? Json(*input.filter_s) : Json(nullptr)},
                  {"formula", "clip((rest_volts - V) / span_volts, 0, 1)"}};
  if (input.scaling.per_window) scaling["levelled"] = true;
  if (input.pitch_mm != InputSettings{}.pitch_mm) scaling["pitch_mm"] = json_of(input.pitch_mm);
  if (input.signal_scale != SignalScale{}) scaling["signals"] = json_of(input.signal_scale);
  if (input.delay_s > 0) scaling["delay_s"] = input.delay_s;
  return {{"settings", settings.dump()}, {"input", scaling.dump()}};
}

std::optional<double> InputSettings::filter_left(double done_s) const {
  constexpr double kSameS = 1e-4;
  const double wanted_s = filter_s.value_or(done_s);
  if (std::abs(wanted_s - done_s) < kSameS) return 0;
  return done_s > 0 ? std::nullopt : std::optional(wanted_s);
}

PixelInterval ModelFile::interval() const {
  return PixelInterval::read(value_or(metadata, "interval_factor")).value_or(PixelInterval{});
}

const ActivationRanges& ModelFile::int8_ranges() const {
  if (ranges) return *ranges;
  throw std::runtime_error(
      "the model was saved without the ranges of its values, which int8 needs; train it anew with this "
      "version, or take precision fp32");
}

TaxelArray ModelFile::array() const {
  const SuperTacSettings& s = model->settings();
  return {static_cast<int>(s.rows), static_cast<int>(s.columns), input.pitch_mm,
          static_cast<int>(s.in_channels)};
}

WindowSettings ModelFile::windows() const {
  WindowSettings w;
  w.timesteps = static_cast<int>(model->settings().timesteps);
  w.scale = static_cast<int>(model->settings().scale);
  w.rate_hz = input.rate_hz;
  w.delay_s = input.delay_s;
  w.scaling = input.scaling;
  w.array = array();
  w.signal_scale = input.signal_scale;
  return w;
}

InputSettings input_of(const WindowSet& windows) {
  return {windows.settings().rate_hz, windows.settings().scaling, windows.filter_s(),
          windows.array().pitch_mm,   windows.signal_scale(),     windows.settings().delay_s};
}

void set_array(SuperTacSettings& settings, const TaxelArray& array) {
  settings.rows = array.rows;
  settings.columns = array.columns;
  settings.in_channels = array.channels;
}

ModelFile load_model(const std::string& path) { return model_of(SafetensorsFile::read(path)); }

ModelFile model_of(const SafetensorsFile& file) {
  const std::string& path = file.path();
  check_checkpoint(file);
  refuse_other_kinds(file);
  const SuperTacSettings settings = read_settings({file.metadata(), path, "settings"});
  ModelFile loaded;
  loaded.path = path;
  loaded.metadata = file.metadata();
  loaded.input = read_input({file.metadata(), path, "input"});
  if (settings.timesteps == 1 && loaded.input.scaling.per_window)
    throw std::runtime_error(path +
                             ": input: a single frame has no rest and gain of its own, found levelled");
  loaded.model = build(settings, file);
  loaded.novelty = Novelty::read(
      file,
      signal_feature_count(loaded.array(), static_cast<std::size_t>(loaded.model->settings().timesteps)));
  loaded.ranges = ActivationRanges::read(file);
  return loaded;
}

std::vector<ModelFile> load_models(std::span<const std::string> paths) {
  std::vector<ModelFile> files;
  for (const std::string& path : paths) {
    files.push_back(load_model(path));
    const SuperTac &model = *files.back().model, &first = *files.front().model;
    const auto ours = model_metadata(model.settings(), files.back().input),
               theirs = model_metadata(first.settings(), files.front().input);
    const bool same_input = ours.at("input") == theirs.at("input"),
               same_pictures = model.format() == first.format() &&
                               model.settings().predicted_error == first.settings().predicted_error;
    if (same_input && same_pictures) continue;
    const char* key = same_input ? "settings" : "input";
    throw std::runtime_error(path + ": its " + key + " are " + ours.at(key) + ", those of " + paths[0] + " " +
                             theirs.at(key) +
                             "; average models that take the same windows and draw the same pictures");
  }
  return files;
}

Precision precision_of(const std::string& name) {
  if (name == "fp32") return Precision::fp32;
  if (name == "int8") return Precision::int8;
  throw std::invalid_argument(refusal("model file", "precision", "fp32 or int8", in_quotes(name)));
}

std::string name_of(Precision precision) { return precision == Precision::int8 ? "int8" : "fp32"; }

CompiledModel compiled(const ModelFile& file, Precision precision) {
  if (precision == Precision::fp32) return CompiledModel(*file.model);
  return CompiledModel(*file.model, file.int8_ranges());
}

Ensemble ensemble_of(std::span<const ModelFile> files, Precision precision) {
  std::vector<CompiledModel> members;
  for (const ModelFile& file : files) members.push_back(compiled(file, precision));
  return Ensemble(std::move(members));
}

void save_model(const std::string& path, const SuperTac& model, const InputSettings& input,
                std::map<std::string, std::string> metadata) {
  metadata.merge(model_metadata(model.settings(), input));
  write_checkpoint(path, model.parameters(), std::move(metadata));
}

}  // namespace supertac
