#include "data/recordings/recording.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>

#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

// What no rig does; a model file has the same limit for its filter.
constexpr double kFastest = 1e4, kLongestFilter = 10, kLongest = 1e10;
constexpr int kMostTruthPixels = 1024;
constexpr const char* kTensors[] = {"time_s", "volts", "signals", "position_mm", "lift_mm", "truth"};
constexpr const char* kFields[] = {"kind",   "plate", "trial",   "pass", "speed_mm_s",
                                   "source", "array", "signals", "body"};

std::optional<std::string> problem_of_truth(const Recording& recording) {
  const int height = recording.truth_height, width = recording.truth_width;
  if (recording.truth.empty() && height == 0 && width == 0) return std::nullopt;
  if (height < 1 || width < 1 || height > kMostTruthPixels || width > kMostTruthPixels)
    return "truth has frames of " + std::to_string(height) + "x" + std::to_string(width) +
           " pixels, expected 1 to " + std::to_string(kMostTruthPixels) + " a side";
  const std::size_t pixels = static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  if (recording.truth.size() != recording.frames() * pixels)
    return "truth has " + std::to_string(recording.truth.size()) + " values, expected " +
           std::to_string(recording.frames() * pixels);
  const auto odd = std::ranges::find_if_not(recording.truth, [](float v) { return v >= 0 && v <= 1; });
  if (odd == recording.truth.end()) return std::nullopt;
  return "truth of frame " +
         std::to_string(static_cast<std::size_t>(odd - recording.truth.begin()) / pixels) + " holds " +
         format(*odd) + ", expected 0 to 1: scale it";
}

}  // namespace

std::optional<std::string> problem_of(const Recording& recording) {
  const std::size_t n = recording.frames();
  const auto sizes = [&](const char* name, std::size_t found, std::size_t expected) {
    return std::string(name) + " has " + std::to_string(found) + " values, expected " +
           std::to_string(expected) + " for " + std::to_string(n) + " frames";
  };
  const std::size_t signals = recording.array.signals();
  if (recording.signals.size() != n * signals) return sizes("signals", recording.signals.size(), n * signals);
  if (!recording.position_mm.empty() && recording.position_mm.size() != n * 2)
    return sizes("position_mm", recording.position_mm.size(), n * 2);
  if (!recording.lift_mm.empty() && recording.lift_mm.size() != n)
    return sizes("lift_mm", recording.lift_mm.size(), n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!std::isfinite(recording.time_s[i])) return "time_s is not finite at frame " + std::to_string(i);
    if (i > 0 && recording.time_s[i] <= recording.time_s[i - 1])
      return "time_s does not increase at frame " + std::to_string(i);
  }
  const auto finite = [](float value) { return std::isfinite(value); };
  const auto odd = static_cast<std::size_t>(std::ranges::find_if_not(recording.signals, finite) -
                                            recording.signals.begin());
  if (odd < n * signals)
    return "signals are not finite at frame " + std::to_string(odd / signals) + ", taxel " +
           std::to_string(static_cast<int>(odd % signals) / recording.array.channels);
  if (std::ranges::any_of(recording.position_mm, [](float value) { return std::isinf(value); }))
    return "position_mm is infinite";
  if (!std::ranges::all_of(recording.lift_mm, finite)) return "lift_mm is not finite";
  if (const auto problem = problem_of_truth(recording)) return problem;
  if (recording.trial < 0 || recording.pass < 0) return "trial and pass must not be negative";
  if (!(recording.speed_mm_s >= 0 && recording.speed_mm_s <= kFastest))
    return "speed_mm_s is " + format(recording.speed_mm_s) + ", expected 0 to " + format(kFastest);
  if (const auto filter = recording.metadata.find("filter_s"); filter != recording.metadata.end())
    if (const auto s = parse_double(filter->second); !s || !(*s >= 0 && *s <= kLongestFilter))
      return "filter_s is " + in_quotes(filter->second) + ", expected 0 to " + format(kLongestFilter) + " s";
  if (recording.metadata.contains("began_s") &&
      !(recording.began_s() >= 0 && recording.began_s() <= kLongest))
    return "began_s is " + in_quotes(recording.metadata.at("began_s")) + ", expected seconds since 1970";
  if (n > 0 &&
      !(std::abs(recording.time_s.front()) <= kLongest && std::abs(recording.time_s.back()) <= kLongest))
    return "time_s lies beyond " + format(kLongest) + " s";
  return std::nullopt;
}

namespace {

/// Takes one of our own fields out of the metadata.
std::string take(std::map<std::string, std::string>& metadata, const std::string& path,
                 const std::string& field) {
  const auto node = metadata.extract(field);
  if (node.empty()) throw FileError(path, "is not a recording: the metadata lacks " + in_quotes(field));
  return node.mapped();
}

int take_count(std::map<std::string, std::string>& metadata, const std::string& path,
               const std::string& field) {
  const std::string text = take(metadata, path, field);
  const auto value = parse_int(text);
  if (!value || *value < 0 || *value > 1'000'000) {
    throw FileError(path, field + " is " + in_quotes(text) + ", expected a number from 0 to 1000000");
  }
  return static_cast<int>(*value);
}

void check_shape(const SafetensorsFile& file, const std::string& name,
                 const std::vector<std::uint64_t>& expected) {
  const auto& shape = file.tensors().at(name).shape;
  if (shape == expected) return;
  throw FileError(file.path(), "tensor " + in_quotes(name) + " has shape " + shape_text(shape) +
                                   ", expected " + shape_text(expected));
}

}  // namespace

double Recording::filter_s() const { return parse_double(value_or(metadata, "filter_s")).value_or(0); }

double Recording::began_s() const { return parse_double(value_or(metadata, "began_s")).value_or(NAN); }

void restate(Recording& recording, const SignalScale& scale) {
  if (recording.signal_scale == scale) return;
  for (float& signal : recording.signals)
    signal = static_cast<float>(recording.signal_scale.in(scale, double{signal}));
  recording.signal_scale = scale;
}

double Recording::period_s() const {
  std::vector<double> steps;
  for (std::size_t i = 1; i < frames(); ++i) steps.push_back(time_s[i] - time_s[i - 1]);
  return steps.empty() ? 0 : median(steps);
}

Recording read_recording(const std::string& path) { return recording_of(SafetensorsFile::read(path)); }

Recording recording_of(const SafetensorsFile& file) {
  const std::string& path = file.path();
  Recording recording;
  recording.metadata = file.metadata();
  recording.metadata.erase(kProvenanceKey);
  const std::string kind = take(recording.metadata, path, "kind");
  if (kind != "recording") throw FileError(path, "is a " + in_quotes(kind) + ", expected a recording");
  recording.plate = take(recording.metadata, path, "plate");
  recording.trial = take_count(recording.metadata, path, "trial");
  recording.pass = take_count(recording.metadata, path, "pass");
  recording.source = take(recording.metadata, path, "source");
  const std::string speed = take(recording.metadata, path, "speed_mm_s");
  const auto speed_value = parse_double(speed);
  if (!speed_value) throw FileError(path, "speed_mm_s is " + in_quotes(speed) + ", expected a number");
  recording.speed_mm_s = *speed_value;
  recording.array = array_of(file);
  if (recording.metadata.erase("signals") > 0)
    recording.signal_scale = scale_of({file.metadata(), path, "signals"});
  if (recording.metadata.erase("body") > 0) recording.body = body_of({file.metadata(), path, "body"});
  recording.metadata.erase("array");
  for (const auto& [name, tensor] : file.tensors())
    if (std::ranges::find(kTensors, name) == std::end(kTensors) ||
        (name == "volts" && name != signals_tensor(file)))
      throw FileError(
          path,
          "holds a tensor " + in_quotes(name) +
              ", which nobody reads; expected time_s, signals (or volts) and, where known, position_mm, "
              "lift_mm and truth: rename it or leave it out");
  recording.time_s = file.f64("time_s");
  recording.signals = file.f32(signals_tensor(file));
  const std::uint64_t n = recording.frames();
  check_shape(file, "time_s", {n});
  check_shape(file, signals_tensor(file), {n, recording.array.signals()});
  const auto take_if_there = [&](const char* name, std::vector<float>& values,
                                 const std::vector<std::uint64_t>& shape) {
    if (!file.tensors().contains(name)) return;
    values = file.f32(name);
    check_shape(file, name, shape);
  };
  take_if_there("position_mm", recording.position_mm, {n, 2});
  take_if_there("lift_mm", recording.lift_mm, {n});
  if (const auto found = file.tensors().find("truth"); found != file.tensors().end()) {
    const std::vector<std::uint64_t>& shape = found->second.shape;
    const auto side = [&](std::size_t axis) {
      return shape.size() == 3 ? static_cast<int>(std::min<std::uint64_t>(shape[axis], INT_MAX)) : 0;
    };
    recording.truth = file.f32("truth");
    recording.truth_height = side(1), recording.truth_width = side(2);
  }
  if (const auto problem = problem_of(recording))
    throw FileError(path, *problem + "; record or import it again");
  return recording;
}

void write_recording(const std::string& path, const Recording& recording) {
  if (const auto problem = problem_of(recording)) throw std::invalid_argument("write_recording: " + *problem);
  recording.array.check();
  const std::uint64_t n = recording.frames();
  std::vector<TensorToWrite> tensors = {{"time_s", "F64", {n}, std::as_bytes(std::span(recording.time_s))},
                                        {signals_tensor(recording.signal_scale),
                                         "F32",
                                         {n, recording.array.signals()},
                                         std::as_bytes(std::span(recording.signals))}};
  const auto add = [&](const char* name, const std::vector<float>& values,
                       const std::vector<std::uint64_t>& shape) {
    if (!values.empty()) tensors.push_back({name, "F32", shape, std::as_bytes(std::span(values))});
  };
  add("position_mm", recording.position_mm, {n, 2});
  add("lift_mm", recording.lift_mm, {n});
  add("truth", recording.truth,
      {n, static_cast<std::uint64_t>(recording.truth_height),
       static_cast<std::uint64_t>(recording.truth_width)});
  write_safetensors(path, metadata_of(recording), tensors);
}

TaxelArray array_of(const SafetensorsFile& file) {
  if (!file.metadata().contains("array")) return {};
  JsonObject keys(file.metadata(), file.path(), "array");
  const TaxelArray array{keys.integer("rows"), keys.integer("columns"), pitch_of(keys),
                         keys.integer("channels")};
  try {
    array.check();
  } catch (const std::invalid_argument& error) {
    throw FileError(file.path(), error.what());
  }
  return array;
}

std::map<std::string, std::string> metadata_of(const TaxelArray& array, const SignalScale& scale) {
  const nlohmann::ordered_json json = {{"rows", array.rows},
                                       {"columns", array.columns},
                                       {"pitch_mm", json_of(array.pitch_mm)},
                                       {"channels", array.channels}};
  return {{"array", json.dump()}, {"signals", json_of(scale).dump()}};
}

std::map<std::string, std::string> metadata_of(const Recording& recording) {
  auto metadata = recording.metadata;
  for (const char* field : kFields)
    if (metadata.contains(field))
      throw std::invalid_argument(refusal("write_recording", "metadata", "no member of the recording",
                                          in_quotes(field) + "; set it there"));
  metadata["kind"] = "recording";
  metadata["plate"] = recording.plate;
  metadata["trial"] = std::to_string(recording.trial);
  metadata["pass"] = std::to_string(recording.pass);
  metadata["speed_mm_s"] = format(recording.speed_mm_s);
  metadata["source"] = recording.source;
  // Files of the rig's array have gone without from the start.
  const auto of_sensor = metadata_of(recording.array, recording.signal_scale);
  if (recording.array != TaxelArray{}) metadata["array"] = of_sensor.at("array");
  if (recording.signal_scale != SignalScale{}) metadata["signals"] = of_sensor.at("signals");
  if (recording.body && *recording.body != Body::usual(recording.array))
    metadata["body"] = json_of(*recording.body).dump();
  return metadata;
}

std::string recording_file_name(const Recording& recording) {
  if (recording.plate.find('/') != std::string::npos)
    throw std::invalid_argument(
        refusal("recording", "plate", "a name without '/'", in_quotes(recording.plate)));
  return recording.plate + "_t" + std::to_string(recording.trial) + "_p" + std::to_string(recording.pass) +
         "_v" + format(recording.speed_mm_s) + ".safetensors";
}

std::vector<std::string> list_recordings(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    if (entry->path().extension() == ".safetensors") paths.push_back(entry->path().string());
  if (error)
    throw FileError(folder, "cannot list the folder: " + error.message() + "; name a folder of recordings");
  if (paths.empty())
    throw FileError(folder,
                    "has no recordings (*.safetensors); make some with supertac-simulate or supertac-import");
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::string hash_of_recordings(const std::string& folder, const std::vector<std::string>& plates) {
  std::multiset<std::string> hashes;
  for (const std::string& path : list_recordings(folder)) {
    const SafetensorsFile file = SafetensorsFile::read(path);
    const auto plate = file.metadata().find("plate");
    if (plate == file.metadata().end()) continue;
    if (plates.empty() || std::find(plates.begin(), plates.end(), plate->second) != plates.end())
      hashes.insert(content_hash(file));
  }
  Sha256 sum;
  for (const std::string& hash : hashes) sum.add(hash);
  return sum.hex();
}

}  // namespace supertac
