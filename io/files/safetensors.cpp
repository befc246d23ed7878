#include "io/files/safetensors.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <stdexcept>

#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

using Tree = nlohmann::ordered_json;

constexpr std::uint64_t kMaxHeaderBytes = std::uint64_t{1} << 20;
constexpr std::size_t kMaxTensors = 8192;
constexpr std::size_t kMaxFields = 4096;  // of the metadata
constexpr std::size_t kMaxRank = 16;
constexpr char kMetadataKey[] = "__metadata__";
constexpr char kFormatKey[] = "supertac_format";
constexpr char kChecksumKey[] = "checksum";
constexpr char kFormatVersion[] = "1";
constexpr std::size_t kChecksumDigits = 8;

struct Header {
  std::map<std::string, std::string> metadata;
  std::map<std::string, TensorInfo> tensors;
};

std::string stamp;  // JSON

[[noreturn]] void refuse(const std::string& path, const std::string& problem) {
  throw FileError(path, "not a safetensors file that can be read: " + problem);
}

// Size of a tensor in bytes; nullopt for an unknown dtype, a rank over kMaxRank, or a product beyond 64 bits.
std::optional<std::uint64_t> tensor_bytes(const std::string& dtype, const std::vector<std::uint64_t>& shape) {
  static const std::map<std::string, std::uint64_t> kBytes = {
      {"BOOL", 1}, {"U8", 1},  {"I8", 1},  {"F8_E4M3", 1}, {"F8_E5M2", 1}, {"U16", 2}, {"I16", 2}, {"F16", 2},
      {"BF16", 2}, {"U32", 4}, {"I32", 4}, {"F32", 4},     {"U64", 8},     {"I64", 8}, {"F64", 8}};
  const auto found = kBytes.find(dtype);
  if (found == kBytes.end() || shape.size() > kMaxRank) return std::nullopt;
  std::uint64_t bytes = found->second;
  for (const std::uint64_t size : shape)
    if (__builtin_mul_overflow(bytes, size, &bytes)) return std::nullopt;
  return bytes;
}

void expect(bool right, const std::string& place, const char* expected, const Tree& found) {
  if (!right) throw JsonError(place + ": expected " + expected + ", found " + shown(found));
}

void expect_at_most(std::size_t most, std::size_t found, const std::string& what) {
  if (found > most) throw JsonError("more than " + std::to_string(most) + " " + what);
}

std::vector<std::uint64_t> numbers(const Tree& list, const std::string& place) {
  expect(list.is_array(), place, "a list", list);
  expect_at_most(kMaxRank, list.size(), "numbers in " + place);
  for (const Tree& value : list)
    expect(value.is_number_unsigned(), place, "a whole number from 0 to 2^64 - 1", value);
  return list;
}

TensorInfo tensor_of(const Tree& entry, const std::string& place) {
  const bool whole = entry.size() == 3 && entry.contains("dtype") && entry.contains("shape") &&
                     entry.contains("data_offsets") && entry["data_offsets"].size() == 2;
  if (!whole) throw JsonError(place + " needs exactly dtype, shape and data_offsets [begin, end]");
  expect(entry["dtype"].is_string(), place + " at 'dtype'", "a text", entry["dtype"]);
  const std::vector<std::uint64_t> offsets = numbers(entry["data_offsets"], place + " at 'data_offsets'");
  return {.dtype = entry["dtype"],
          .shape = numbers(entry["shape"], place + " at 'shape'"),
          .begin = offsets[0],
          .end = offsets[1]};
}

// The header's JSON, checked for itself. Throws JsonError.
Header parse_header(std::string_view text) {
  if (text.empty() || text.front() != '{') throw JsonError("does not begin with '{'");
  // JSON would allow any white space here; one spelling less is one ambiguity less.
  const std::size_t last = text.find_last_not_of(' ');
  if (text[last] != '}') throw JsonError("does not end with '}' and spaces");
  // {"__metadata__": {text: text}, name: {"dtype": text, "shape": [n...], "data_offsets": [begin, end]}, ...}
  Header header;
  const Tree tree = parse_json_limited(text, {.max_depth = 4});
  for (const auto& [name, entry] : tree.items()) {
    const std::string place = (name == kMetadataKey ? "" : "tensor ") + in_quotes(name);
    expect(entry.is_object(), place, "an object", entry);
    if (name != kMetadataKey) {
      header.tensors.emplace(name, tensor_of(entry, place));
      expect_at_most(kMaxTensors, header.tensors.size(), "tensors");
      continue;
    }
    expect_at_most(kMaxFields, entry.size(), "metadata fields");
    for (const auto& [field, value] : entry.items()) {
      expect(value.is_string(), place + " at " + in_quotes(field), "a text", value);
      header.metadata.emplace(field, value);
    }
  }
  return header;
}

// Where the digits of the checksum stand in the header's text; nullopt when there are none.
std::optional<std::size_t> checksum_position(std::string_view text) {
  // A quote inside a JSON string is escaped, so this text is a key with a string value: in __metadata__.
  const std::string key = std::string("\"") + kChecksumKey + "\":\"";
  const std::size_t found = text.find(key);
  if (found == std::string_view::npos) return std::nullopt;
  const std::size_t digits = found + key.size();
  const std::size_t end = text.find_first_not_of("0123456789abcdef", digits);
  if (end != digits + kChecksumDigits || text[end] != '"') return std::nullopt;
  return digits;
}

// Fills a span with the next bytes of the file.
using Take = std::function<void(std::span<std::byte>)>;

std::uint64_t take_header_length(const std::string& path, std::uint64_t size, const Take& take) {
  if (size < 8) {
    refuse(path, "has " + std::to_string(size) + " bytes, expected at least 8; is it complete?");
  }
  std::uint64_t length = 0;
  take(std::as_writable_bytes(std::span(&length, 1)));
  if (length > kMaxHeaderBytes) {
    refuse(path, "header length " + std::to_string(length) + ", expected at most " +
                     std::to_string(kMaxHeaderBytes) + "; is it the right kind of file?");
  }
  if (length > size - 8) {
    refuse(path, "header length " + std::to_string(length) + ", but only " + std::to_string(size - 8) +
                     " bytes follow; it is cut short");
  }
  return length;
}

// Names and tensors as they lie in the file.
std::vector<std::pair<const std::string*, const TensorInfo*>> in_order(
    const std::map<std::string, TensorInfo>& tensors) {
  std::vector<std::pair<const std::string*, const TensorInfo*>> order;
  for (const auto& [name, info] : tensors) order.emplace_back(&name, &info);
  std::ranges::stable_sort(order, {},
                           [](const auto& one) { return std::pair(one.second->begin, one.second->end); });
  return order;
}

// Tensors must tile [0, data_bytes) exactly.
void check_layout(const std::string& path, const std::map<std::string, TensorInfo>& tensors,
                  std::uint64_t data_bytes) {
  std::uint64_t next = 0;
  for (const auto& [name, info] : in_order(tensors)) {
    const auto bytes = tensor_bytes(info->dtype, info->shape);
    if (!bytes)
      refuse(path, "tensor " + in_quotes(*name) + " has unknown type " + in_quotes(info->dtype) +
                       " or is too large");
    if (info->end < info->begin || info->end - info->begin != *bytes) {
      refuse(path, "tensor " + in_quotes(*name) + " spans bytes " + std::to_string(info->begin) + " to " +
                       std::to_string(info->end) + ", its shape and type need " + std::to_string(*bytes));
    }
    if (info->begin != next) {
      refuse(path, "tensor " + in_quotes(*name) + " begins at byte " + std::to_string(info->begin) +
                       ", expected " + std::to_string(next));
    }
    next = info->end;
  }
  if (next != data_bytes) {
    refuse(path, "the tensors need " + std::to_string(next) + " bytes of data, the file has " +
                     std::to_string(data_bytes) + (next > data_bytes ? "; it is cut short" : ""));
  }
}

// The version comes first: a newer one may check itself in another way.
void check_version(const std::string& path, const std::map<std::string, std::string>& metadata) {
  const auto found = metadata.find(kFormatKey);
  if (found == metadata.end() || found->second == kFormatVersion) return;
  const auto version = parse_uint(found->second);
  if (version && *version > 1) {
    refuse(path, "format version " + std::to_string(*version) + ", this program reads up to " +
                     kFormatVersion + "; use a newer SuperTac");
  }
  refuse(path,
         "format version " + in_quotes(found->second) + ", expected " + kFormatVersion + "; it is damaged");
}

// False when there is none.
bool check_checksum(const std::string& path, const Header& header, std::string text,
                    std::span<const std::byte> data) {
  const auto stored = header.metadata.find(kChecksumKey);
  if (stored == header.metadata.end()) {
    if (!header.metadata.contains(kFormatKey)) return false;
    refuse(path, "the checksum is missing; it is damaged");
  }
  if (!header.metadata.contains(kFormatKey))
    refuse(path, "a checksum without a format version; it is damaged");
  const auto position = checksum_position(text);
  if (!position) refuse(path, "the checksum " + in_quotes(stored->second) + " is malformed; it is damaged");
  text.replace(*position, kChecksumDigits, kChecksumDigits, '0');
  const std::string found = hex_digits(crc32(data, crc32(std::as_bytes(std::span(text)))), kChecksumDigits);
  if (found != stored->second) {
    refuse(path, "checksum " + found + ", expected " + in_quotes(stored->second) +
                     "; it is damaged, or another program changed it and kept our checksum");
  }
  return true;
}

[[noreturn]] void wrong(const std::string& argument, const std::string& expected, const std::string& got) {
  throw std::invalid_argument(refusal("write_safetensors", argument, expected, got));
}

void hand_over(const TensorToWrite& tensor, const ByteSink& sink) {
  tensor.read ? tensor.read(sink) : sink(tensor.data);
}

// Throws std::invalid_argument for a tensor with other bytes than its shape and type need.
std::uint32_t checksum_of(const std::string& header, std::span<const TensorToWrite> tensors) {
  std::uint32_t sum = crc32(std::as_bytes(std::span(header)));
  for (const TensorToWrite& tensor : tensors) {
    std::uint64_t bytes = 0;
    hand_over(tensor, [&](std::span<const std::byte> piece) {
      sum = crc32(piece, sum);
      bytes += piece.size();
    });
    const std::uint64_t expected = *tensor_bytes(tensor.dtype, tensor.shape);
    if (bytes != expected)
      wrong("tensor " + in_quotes(tensor.name), std::to_string(expected) + " bytes", std::to_string(bytes));
  }
  return sum;
}

// What stands in the file before the data, which begin at a multiple of 8 bytes: JSON with version and
// checksum. Types and shapes must be good.
std::string header_text(std::map<std::string, std::string> metadata, std::span<const TensorToWrite> tensors) {
  metadata[kFormatKey] = kFormatVersion;
  metadata[kChecksumKey] = std::string(kChecksumDigits, '0');
  Tree header = {{kMetadataKey, std::move(metadata)}};
  Tree::object_t::Container& entries = header.get_ref<Tree::object_t&>();
  std::uint64_t begin = 0;
  for (const TensorToWrite& tensor : tensors) {
    const std::uint64_t end = begin + *tensor_bytes(tensor.dtype, tensor.shape);
    Tree entry = {{"dtype", tensor.dtype}, {"shape", tensor.shape}, {"data_offsets", {begin, end}}};
    entries.emplace_back(tensor.name, std::move(entry));
    begin = end;
  }
  std::string text = header.dump();
  text.resize((text.size() + 7) / 8 * 8, ' ');
  return text.replace(*checksum_position(text), kChecksumDigits,
                      hex_digits(checksum_of(text, tensors), kChecksumDigits));
}

// All bytes of a file, front to back.
void hand_over(const std::string& header, std::span<const TensorToWrite> tensors, const ByteSink& sink) {
  const std::uint64_t length = header.size();
  sink(std::as_bytes(std::span(&length, 1)));
  sink(std::as_bytes(std::span(header)));
  for (const TensorToWrite& tensor : tensors) hand_over(tensor, sink);
}

void check_writable(const std::map<std::string, std::string>& metadata,
                    const std::vector<TensorToWrite>& tensors) {
  for (const char* key : {kFormatKey, kChecksumKey})
    if (metadata.contains(key)) wrong("metadata", "no field that this function writes", in_quotes(key));
  if (metadata.size() + 2 > kMaxFields)
    wrong("metadata", "at most " + std::to_string(kMaxFields - 2) + " fields",
          std::to_string(metadata.size()));
  if (tensors.size() > kMaxTensors)
    wrong("tensors", "at most " + std::to_string(kMaxTensors), std::to_string(tensors.size()));
  std::set<std::string> names = {kMetadataKey};
  for (const TensorToWrite& tensor : tensors) {
    if (!names.insert(tensor.name).second) wrong("tensors", "names not taken", in_quotes(tensor.name));
    const auto bytes = tensor_bytes(tensor.dtype, tensor.shape);
    if (!bytes)
      wrong("tensor " + in_quotes(tensor.name), "a known type, rank <= 16, below 2^64 bytes",
            in_quotes(tensor.dtype) + " [" + joined(tensor.shape) + "]");
  }
}

}  // namespace

SafetensorsFile SafetensorsFile::read(const std::string& path) {
  FileReader reader(path);
  return parsed(path, reader.size(), [&](std::span<std::byte> to) { reader.read(to); });
}

SafetensorsFile SafetensorsFile::of(std::span<const std::byte> bytes, const std::string& name) {
  return parsed(name, bytes.size(), [&](std::span<std::byte> to) {
    std::ranges::copy(bytes.first(to.size()), to.begin());
    bytes = bytes.subspan(to.size());
  });
}

SafetensorsFile SafetensorsFile::parsed(const std::string& path, std::uint64_t size, const Take& take) {
  std::string text(take_header_length(path, size, take), ' ');
  take(std::as_writable_bytes(std::span(text)));
  Header header;
  try {
    header = parse_header(text);
  } catch (const JsonError& error) {
    refuse(path, std::string("header: ") + error.what());
  }
  check_version(path, header.metadata);
  const std::uint64_t data_bytes = size - 8 - text.size();
  check_layout(path, header.tensors, data_bytes);

  SafetensorsFile file;
  file.path_ = path;
  file.data_.resize(data_bytes);
  take(file.data_);
  file.has_checksum_ = check_checksum(path, header, std::move(text), file.data_);
  if (file.has_checksum_) {
    header.metadata.erase(kFormatKey);
    header.metadata.erase(kChecksumKey);
  }
  file.metadata_ = std::move(header.metadata);
  file.tensors_ = std::move(header.tensors);
  return file;
}

const TensorInfo& SafetensorsFile::info(const std::string& name) const {
  const auto found = tensors_.find(name);
  if (found != tensors_.end()) return found->second;
  const std::string names =
      joined(tensors_, ", ", [](const auto& tensor) { return in_quotes(tensor.first); });
  throw FileError(path_, "has no tensor " + in_quotes(name) +
                             " (it has: " + (names.empty() ? "none" : printable(names, 200)) + ")");
}

std::span<const std::byte> SafetensorsFile::bytes(const std::string& name) const {
  const TensorInfo& tensor = info(name);
  return std::span(data_).subspan(tensor.begin, tensor.end - tensor.begin);
}

template <class Element>
std::vector<Element> SafetensorsFile::elements(const std::string& name, const char* dtype) const {
  if (info(name).dtype != dtype) {
    throw FileError(path_,
                    "tensor " + in_quotes(name) + " has type " + info(name).dtype + ", expected " + dtype);
  }
  const auto source = bytes(name);
  std::vector<Element> values(source.size() / sizeof(Element));
  if (!values.empty()) std::memcpy(values.data(), source.data(), source.size());
  return values;
}

std::vector<float> SafetensorsFile::f32(const std::string& name) const {
  return elements<float>(name, "F32");
}
std::vector<double> SafetensorsFile::f64(const std::string& name) const {
  return elements<double>(name, "F64");
}

void write_safetensors(const OutputPath& output, std::map<std::string, std::string> metadata,
                       const std::vector<TensorToWrite>& tensors) {
  if (!provenance().empty()) metadata[kProvenanceKey] = provenance();
  check_writable(metadata, tensors);
  std::string text;
  try {
    text = header_text(std::move(metadata), tensors);
  } catch (const nlohmann::json::exception&) {
    wrong("names and metadata", "valid UTF-8", "other bytes");
  }
  if (text.size() > kMaxHeaderBytes)
    wrong("header", "at most " + std::to_string(kMaxHeaderBytes) + " bytes", std::to_string(text.size()));

  AtomicFile file(output);
  hand_over(text, tensors, [&file](std::span<const std::byte> piece) { file.write(piece); });
  file.commit();
}

void set_provenance(std::string json) { stamp = std::move(json); }
const std::string& provenance() { return stamp; }

std::string content_hash(const SafetensorsFile& file) {
  std::map<std::string, std::string> metadata = file.metadata();
  metadata.erase(kProvenanceKey);
  std::vector<TensorToWrite> tensors;
  for (const auto& [name, info] : in_order(file.tensors()))
    tensors.push_back({*name, info->dtype, info->shape, file.bytes(*name)});
  Sha256 hash;
  hand_over(header_text(std::move(metadata), tensors), tensors,
            [&hash](std::span<const std::byte> piece) { hash.add(piece); });
  return hash.hex();
}

std::string shape_text(const std::vector<std::uint64_t>& shape) { return "[" + joined(shape) + "]"; }

std::string value_or(const std::map<std::string, std::string>& metadata, const std::string& key,
                     const std::string& otherwise) {
  const auto found = metadata.find(key);
  return found == metadata.end() ? otherwise : found->second;
}

}  // namespace supertac
