// supertac-info: the card of a recording, a model, or any other safetensors file, and of a folder of
// recordings: what it holds and how it was made.

#include <cmath>
#include <filesystem>
#include <sstream>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/files/exports.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments.positional("FILE", "a .safetensors file, or a folder of recordings");
  arguments.flag(
      "chain",
      "of a model: the hashes of all that lies between its recordings and a microcontroller's picture");
}

namespace {

using Json = nlohmann::ordered_json;

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
Json value_of(const std::string& text) {
  if (!text.starts_with('{')) return text;
  try {
    return parse_json_limited(text);
  } catch (const JsonError&) {
    return text;
  }
}

/// What a recording adds; reads the file as one, so that what is wrong with it is said here too.
Json card_of_recording(const std::string& path) {
  const Recording recording = read_recording(path);
  const std::size_t n = recording.frames();
  const double duration = n > 0 ? recording.time_s.back() - recording.time_s.front() : 0;
  return {{"frames", n},
          {"duration_s", duration},
          {"mean_rate_hz", duration > 0 ? static_cast<double>(n - 1) / duration : 0},
          {"position_known", !recording.position_mm.empty()}};
}

Json card_of_file(const std::string& path) {
  const SafetensorsFile file = SafetensorsFile::read(path);
  Json card = {{"file", file.path()}, {"kind", kind_of(file)}, {"content", content_hash(file)}};
  card["checksum"] = file.has_checksum() ? "ok" : "absent";
  if (card["kind"] == "recording") card.update(card_of_recording(path));
  std::uint64_t values = 0;
  Json tensors = Json::array();
  for (const auto& [name, tensor] : file.tensors()) {
    values += elements(tensor);
    tensors.push_back({{"name", name}, {"dtype", tensor.dtype}, {"shape", tensor.shape}});
  }
  card["values"] = values;
  for (const auto& [key, text] : file.metadata()) card["metadata"][key] = value_of(text);
  card["tensors"] = std::move(tensors);
  return card;
}

/// Of a folder of recordings: what all have in common in their provenance, and each time that it was filled.
Json card_of_folder(const std::string& folder) {
  namespace fs = std::filesystem;
  constexpr std::uint64_t kMostBytes = 16 << 20;
  Json card = {{"folder", folder},
               {"kind", "recordings"},
               {"files", list_recordings(folder).size()},
               {"content", hash_of_recordings(folder, {})},
               {"provenance", Json::array()}};
  const fs::path made = fs::path(folder) / kFolderProvenance;
  std::error_code error;
  std::istringstream lines(fs::exists(made, error) ? read_text_file(made, kMostBytes) : "");
  for (std::string line; std::getline(lines, line);)
    if (Json entry = value_of(line); entry.is_object()) card["provenance"].push_back(std::move(entry));
  return card;
}

void print_row(const Arguments& arguments, const std::string& name, const Json& value) {
  const std::string text = value.is_string()         ? value.get<std::string>()
                           : value.is_number_float() ? format(value.get<double>())
                                                     : value.dump();
  arguments.print(left_aligned(printable(name), 28) + printable(text, 200));
}

/// A row for each entry; in a card of `ours` a tensor is one, and each filling of a folder stands below an
/// empty line.
void print_card(const Arguments& arguments, const Json& card, const std::string& before = "",
                bool ours = true) {
  for (const auto& [key, value] : card.items()) {
    if (value.is_object()) {
      print_card(arguments, value, key == "metadata" ? "" : before + key + ".", false);
    } else if (ours && key == "tensors") {
      for (const Json& tensor : value)
        print_row(arguments, "  " + tensor["name"].get<std::string>(),
                  tensor["dtype"].get<std::string>() + " " + tensor["shape"].dump());
    } else if (ours && key == "provenance") {
      for (const Json& filling : value) arguments.print(""), print_card(arguments, filling, "", false);
    } else if (ours && value.is_number_float()) {
      print_row(arguments, key, std::round(1e3 * value.get<double>()) / 1e3);
    } else if (ours && key == "checksum" && value == "absent") {
      print_row(arguments, key, "absent: written by another program, damage cannot be seen");
    } else {
      print_row(arguments, before + key, value);
    }
  }
}

// As supertac-export --c99 writes it without other options.
int print_chain(const Arguments& arguments) {
  Json chain = Json::array();
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
  const std::string path = arguments.text("FILE");
  const Json card = std::filesystem::is_directory(path) ? card_of_folder(path) : card_of_file(path);
  print_card(arguments, card);
  arguments.write_json(card);
  return kExitOk;
}

}  // namespace supertac
