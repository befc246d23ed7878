#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "data/recordings/imports/imports.h"
#include "data/recordings/resample.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

using Shape = std::vector<std::uint64_t>;

const Shape& shape_of(const SafetensorsFile& file, const char* name, const char* expected) {
  const auto found = file.tensors().find(name);
  if (found == file.tensors().end())
    throw FileError(file.path(), std::string("has no tensor '") + name +
                                     "'; expected input F32 [N,C,H,W] and target F32 [N,1,sH,sW]");
  const auto& [dtype, shape, begin, end] = found->second;
  if (dtype != "F32" || shape.size() != 4 || std::ranges::find(shape, 0U) != shape.end())
    throw FileError(file.path(), std::string("tensor '") + name + "' is " + dtype + " " + shape_text(shape) +
                                     ", expected F32 " + expected + "; convert it before saving");
  return shape;
}

TaxelArray array_of(const SafetensorsFile& file, const Shape& input, const Shape& target) {
  const auto refuse = [&](const std::string& what) {
    throw FileError(file.path(),
                    "input " + shape_text(input) + ", target " + shape_text(target) + ": " + what);
  };
  if (target[0] != input[0] || target[1] != 1) refuse("expected as many targets as inputs, of one channel");
  if (input[1] > 8 || input[2] > 64 || input[3] > 64)
    refuse("expected 1 to 8 channels and 1 to 64 rows and columns in input");
  const std::uint64_t scale = target[2] / input[2];
  const bool fits = target[2] == input[2] * scale && target[3] == input[3] * scale;
  if (!fits || (scale != 2 && scale != 4 && scale != 8 && scale != 16))
    refuse("expected target's height and width to be 2, 4, 8 or 16 times input's");
  const auto whole = [](std::uint64_t size) { return static_cast<int>(size); };
  return {whole(input[2]), whole(input[3]), 1, whole(input[1])};
}

void check_values(const SafetensorsFile& file, const char* name, std::span<const float> values,
                  std::uint64_t count, bool (*right)(float), const char* expected) {
  const auto odd = std::ranges::find_if_not(values, right);
  if (odd == values.end()) return;
  const std::size_t pair = static_cast<std::size_t>(odd - values.begin()) / (values.size() / count);
  throw FileError(file.path(), std::string(name) + " of pair " + std::to_string(pair) + " holds " +
                                   format(*odd) + ", expected " + expected);
}

// The frames of each group, by its name; all digits are as many, so that names sort as numbers do.
std::map<std::string, std::vector<std::size_t>> groups_of(const SafetensorsFile& file, std::uint64_t count) {
  const auto found = file.tensors().find("group");
  std::map<std::string, std::vector<std::size_t>> groups;
  if (found == file.tensors().end()) {
    for (std::size_t i = 0; i < count; ++i) groups[""].push_back(i);
    return groups;
  }
  const auto& [dtype, shape, begin, end] = found->second;
  if (shape != Shape{count} || dtype != "I64")
    throw FileError(file.path(), "tensor 'group' is " + dtype + " " + shape_text(shape) + ", expected I64 [" +
                                     std::to_string(count) + "]");
  std::vector<std::int64_t> numbers(count);
  std::memcpy(numbers.data(), file.bytes("group").data(), count * sizeof(std::int64_t));
  const std::size_t digits = std::to_string(std::ranges::max(numbers)).size();
  for (std::size_t i = 0; i < count; ++i) {
    std::string name = std::to_string(numbers[i]);
    groups[name.insert(0, digits - std::min(digits, name.size()), '0')].push_back(i);
  }
  return groups;
}

// Refuses targets that show touches at other frames than the inputs. How fast frames came is not known: as if
// 50 in a second.
void check_lag(const SafetensorsFile& file, const std::string& group, const Recording& recording) {
  constexpr double kFrameS = 0.02;
  std::vector<double> time_s;
  for (std::size_t i = 0; i < recording.frames(); ++i) time_s.push_back(kFrameS * static_cast<double>(i));
  const auto clock = clock_of_truth(recording, time_s);
  if (!clock) return;
  const double middle = time_s.back() / 2, frames = (middle - clock->sensor_s(middle)) / kFrameS,
               deviation = clock->offset_deviation_s / kFrameS;
  if (std::abs(frames) <= std::max(1.5, 4 * deviation)) return;
  throw FileError(file.path(), (group.empty() ? "" : "group " + group + ": ") + "target shows touches " +
                                   format(std::abs(frames), 1) + " +- " + format(deviation, 1) + " frames " +
                                   (frames > 0 ? "later" : "earlier") +
                                   " than input; pair each input with its own target, or import frames as a "
                                   "table and the film with its times (--truth)");
}

}  // namespace

std::vector<Recording> import_pairs(const SafetensorsFile& file, const std::optional<Sensor>& sensor) {
  const Shape &input = shape_of(file, "input", "[N,C,H,W]"),
              &target = shape_of(file, "target", "[N,1,sH,sW]");
  Recording like;
  like.array = array_of(file, input, target);
  like.source = "imported";
  like.truth_height = static_cast<int>(target[2]), like.truth_width = static_cast<int>(target[3]);
  const std::vector<float> inputs = file.f32("input"), targets = file.f32("target");
  check_values(
      file, "input", inputs, input[0], [](float v) { return std::isfinite(v); }, "finite values");
  check_values(
      file, "target", targets, target[0], [](float v) { return v >= 0 && v <= 1; },
      "0 to 1; scale the targets");
  const auto [low, high] = std::ranges::minmax(inputs);
  like.signal_scale = {.unit = "1", .rest = low, .span = low < high ? double{low} - double{high} : -1};
  if (sensor) {
    like.array.pitch_mm = sensor->array.pitch_mm, like.signal_scale = sensor->scale, like.body = sensor->body;
    if (like.array != sensor->array)
      throw FileError(file.path(), "holds frames of " + like.array.text() +
                                       ", expected those of the sensor, " + sensor->array.text());
    if (const std::string why = contradiction(inputs, sensor->scale); !why.empty())
      throw FileError(file.path(),
                      "input runs " + why + "; save it in the sensor's unit, or mend the sensor's file");
  }
  const auto channels = static_cast<std::size_t>(like.array.channels),
             taxels = static_cast<std::size_t>(like.array.taxels()),
             pixels = targets.size() / static_cast<std::size_t>(target[0]);
  std::vector<Recording> recordings;
  for (const auto& [name, frames] : groups_of(file, input[0])) {
    Recording recording = like;
    recording.plate = name.empty() ? "pairs" : name;
    if (!name.empty()) recording.metadata["group"] = name;
    recording.pass = 1;
    for (const std::size_t i : frames) {
      recording.time_s.push_back(static_cast<double>(recording.time_s.size()));
      for (std::size_t s = 0; s < taxels * channels; ++s)  // channels come last in recordings
        recording.signals.push_back(inputs[(i * channels + s % channels) * taxels + s / channels]);
      const auto truth = std::span(targets).subspan(i * pixels, pixels);
      recording.truth.insert(recording.truth.end(), truth.begin(), truth.end());
    }
    check_lag(file, name, recording);
    recordings.push_back(std::move(recording));
  }
  return recordings;
}

}  // namespace supertac
