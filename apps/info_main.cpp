// supertac-info: the card of a recording, a model, or any other safetensors file, and of a folder of
// recordings: what it holds and how it was made.

#include <filesystem>
#include <sstream>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/provenance.h"
#include "io/files/safetensors.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/files/chain.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments.positional("FILE", "a .safetensors file, or a folder of recordings");
  arguments.flag(
      "chain",
      "of a model: the hashes of all that lies between its recordings and a microcontroller's picture");
}

namespace {

std::uint64_t elements(const TensorInfo& tensor) {
  std::uint64_t count = 1;
  for (const std::uint64_t size : tensor.shape) count *= size;
  return count;
}

std::string kind_of(const SafetensorsFile& file) {
  const auto& metadata = file.metadata();
  const std::string format = value_or(metadata, "format");
  return value_or(metadata, "kind",
                  format.starts_with("supertac-") ? format.substr(9) : "safetensors of another program");
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
  card["content"] = content_hash(file);
  card["checksum"] = file.has_checksum() ? "ok" : "absent";
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
  arguments.print(left_aligned(printable(name), 28) + printable(value, 200));
}

std::string text_of(const nlohmann::ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

void print_metadata(const Arguments& arguments, const SafetensorsFile& file) {
  for (const auto& [key, text] : file.metadata()) {
    const auto value = value_of(text);
    if (!value.is_object()) {
      print_row(arguments, key, text);
      continue;
    }
    for (const auto& [name, entry] : value.items()) {
      print_row(arguments, key + "." + name, text_of(entry));
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

/// A folder of recordings: what all have in common in their provenance, and each time that it was filled.
int describe_folder(const Arguments& arguments) {
  namespace fs = std::filesystem;
  constexpr std::uint64_t kMostBytes = 16 << 20;
  const std::string folder = arguments.text("FILE");
  const std::size_t count = list_recordings(folder).size();
  nlohmann::ordered_json card = {{"folder", folder},
                                 {"kind", "recordings"},
                                 {"files", count},
                                 {"content", hash_of_recordings(folder, {})},
                                 {"provenance", nlohmann::ordered_json::array()}};
  for (const char* key : {"folder", "kind", "files", "content"})
    print_row(arguments, key, text_of(card[key]));
  const fs::path made = fs::path(folder) / kFolderProvenance;
  std::error_code error;
  std::istringstream lines(fs::exists(made, error) ? read_text_file(made, kMostBytes) : "");
  for (std::string line; std::getline(lines, line);) {
    const auto entry = value_of(line);
    if (!entry.is_object()) continue;
    arguments.print("");
    for (const auto& [key, value] : entry.items()) print_row(arguments, key, text_of(value));
    card["provenance"].push_back(entry);
  }
  arguments.write_json(card);
  return kExitOk;
}

// As supertac-export --c99 writes it without other options.
int print_chain(const Arguments& arguments) {
  nlohmann::ordered_json chain = nlohmann::ordered_json::array();
  for (const ChainLink& link : exported(SafetensorsFile::read(arguments.text("FILE")), "finger", 0).chain) {
    print_row(arguments, link.name, link.hash);
    chain.push_back({{"link", link.name}, {"hash", link.hash}});
  }
  arguments.write_json({{"file", arguments.text("FILE")}, {"chain", chain}});
  return kExitOk;
}

}  // namespace

int run(Arguments& arguments) {
  if (arguments.flag("chain")) return print_chain(arguments);
  if (std::filesystem::is_directory(arguments.text("FILE"))) return describe_folder(arguments);
  const SafetensorsFile file = SafetensorsFile::read(arguments.text("FILE"));
  const std::string kind = kind_of(file);
  auto result = card(file, kind);
  const bool ours = file.has_checksum();
  print_row(arguments, "file", file.path());
  print_row(arguments, "kind", kind);
  print_row(arguments, "content", text_of(result["content"]));
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
