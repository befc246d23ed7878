// supertac-info: the card of a recording, a checkpoint, or any other safetensors file.

#include "apps/common/program.h"
#include "data/recordings/recording.h"
#include "io/file.h"
#include "io/json.h"
#include "io/numbers.h"
#include "io/safetensors.h"
#include "io/text.h"

namespace supertac {

void declare(Arguments& arguments) { arguments.positional("FILE", "a .safetensors file"); }

namespace {

std::string shape_text(const std::vector<std::uint64_t>& shape) {
  std::string text;
  for (const std::uint64_t size : shape) text += (text.empty() ? "" : ",") + std::to_string(size);
  return "[" + text + "]";
}

std::uint64_t elements(const TensorInfo& tensor) {
  std::uint64_t count = 1;
  for (const std::uint64_t size : tensor.shape) count *= size;
  return count;
}

std::string kind_of(const SafetensorsFile& file) {
  const auto& metadata = file.metadata();
  if (const auto kind = metadata.find("kind"); kind != metadata.end()) return kind->second;
  const auto format = metadata.find("format");
  if (format != metadata.end() && format->second.starts_with("supertac-")) return format->second.substr(9);
  return "safetensors of another program";
}

/// Metadata values are text; those that hold a JSON object are shown as one, the rest as they are.
nlohmann::ordered_json value_of(const std::string& text) {
  if (!text.starts_with('{')) return text;
  try {
    return parse_json_limited(text);
  } catch (const JsonError&) {
    return text;
  }
}

nlohmann::ordered_json card(const SafetensorsFile& file, const std::string& kind) {
  nlohmann::ordered_json card = {{"file", file.path()}, {"kind", kind}};
  card["checksum"] = file.checksum() == SafetensorsFile::ChecksumState::ok ? "ok" : "absent";
  std::uint64_t values = 0;
  nlohmann::ordered_json tensors = nlohmann::ordered_json::array();
  for (const auto& [name, tensor] : file.tensors()) {
    values += elements(tensor);
    tensors.push_back({{"name", name}, {"dtype", tensor.dtype}, {"shape", tensor.shape}});
  }
  card["values"] = values;
  for (const auto& [key, text] : file.metadata()) card["metadata"][key] = value_of(text);
  card["tensors"] = std::move(tensors);
  return card;
}

void print_row(const Arguments& arguments, const std::string& name, const std::string& value) {
  constexpr std::size_t kColumn = 28;
  const std::string shown = printable(name);
  arguments.print(shown + std::string(shown.size() < kColumn ? kColumn - shown.size() : 1, ' ') +
                  printable(value, 200));
}

void print_metadata(const Arguments& arguments, const SafetensorsFile& file) {
  for (const auto& [key, text] : file.metadata()) {
    const auto value = value_of(text);
    if (!value.is_object()) {
      print_row(arguments, key, text);
      continue;
    }
    for (const auto& [name, entry] : value.items()) {
      print_row(arguments, key + "." + name, entry.is_string() ? entry.get<std::string>() : entry.dump());
    }
  }
}

/// Frames, duration and rate; reads the file as a recording, so that what is wrong with it is said here too.
void print_recording(const Arguments& arguments, nlohmann::ordered_json& card) {
  const Recording recording = read_recording(arguments.text("FILE"));
  const std::size_t n = recording.frames();
  const double duration = n > 0 ? recording.time_s.back() - recording.time_s.front() : 0;
  const double rate = duration > 0 ? static_cast<double>(n - 1) / duration : 0;
  print_row(arguments, "frames", std::to_string(n));
  print_row(arguments, "duration", format(duration, 3) + " s");
  print_row(arguments, "mean rate", format(rate, 2) + " Hz");
  print_row(arguments, "position", recording.position_mm.empty() ? "unknown" : "known");
  card["frames"] = n;
  card["duration_s"] = duration;
  card["mean_rate_hz"] = rate;
  card["position_known"] = !recording.position_mm.empty();
}

}  // namespace

int run(Arguments& arguments) {
  const SafetensorsFile file = SafetensorsFile::read(arguments.text("FILE"));
  const std::string kind = kind_of(file);
  auto result = card(file, kind);
  const bool ours = file.checksum() == SafetensorsFile::ChecksumState::ok;
  print_row(arguments, "file", file.path());
  print_row(arguments, "kind", kind);
  print_row(arguments, "checksum", ours ? "ok" : "absent: written by another program, damage cannot be seen");
  if (kind == "recording") print_recording(arguments, result);
  print_metadata(arguments, file);
  print_row(arguments, "values in all tensors", std::to_string(result["values"].get<std::uint64_t>()));
  for (const auto& [name, tensor] : file.tensors()) {
    print_row(arguments, "  " + name, tensor.dtype + " " + shape_text(tensor.shape));
  }
  arguments.write_json(result);
  return kExitOk;
}

}  // namespace supertac
