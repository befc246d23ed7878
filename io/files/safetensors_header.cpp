#include "io/files/safetensors_header.h"

#include "io/files/json.h"
#include "io/numbers/hash.h"
#include "io/numbers/text.h"

namespace supertac::safetensors {
namespace {

using Tree = nlohmann::ordered_json;

const char* kind_of(const Tree& value) {
  if (value.is_null()) return "null";
  if (value.is_boolean()) return "a boolean";
  if (value.is_string()) return "a string";
  if (value.is_array()) return "an array";
  if (value.is_object()) return "an object";
  if (value.is_number_unsigned()) return "a number";
  return value.is_number_float() ? "a fraction or a number beyond 64 bits" : "a negative number";
}

void expect(bool right, const std::string& place, const char* expected, const Tree& found) {
  if (!right) throw JsonError(place + ": expected " + expected + ", found " + kind_of(found));
}

void expect_at_most(std::size_t most, std::size_t found, const std::string& what) {
  if (found > most) throw JsonError("more than " + std::to_string(most) + " " + what);
}

std::vector<std::uint64_t> numbers(const Tree& list, const std::string& place) {
  expect(list.is_array(), place, "a list", list);
  expect_at_most(kMaxRank, list.size(), "numbers in " + place);
  for (const Tree& value : list) expect(value.is_number_unsigned(), place, "a whole number", value);
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

std::uint64_t dtype_bytes(const std::string& dtype) {
  static const std::map<std::string, std::uint64_t> kBytes = {
      {"BOOL", 1}, {"U8", 1},  {"I8", 1},  {"F8_E4M3", 1}, {"F8_E5M2", 1}, {"U16", 2}, {"I16", 2}, {"F16", 2},
      {"BF16", 2}, {"U32", 4}, {"I32", 4}, {"F32", 4},     {"U64", 8},     {"I64", 8}, {"F64", 8}};
  const auto found = kBytes.find(dtype);
  return found == kBytes.end() ? 0 : found->second;
}

}  // namespace

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

std::string header_text(const std::map<std::string, std::string>& metadata,
                        std::span<const TensorToWrite> tensors) {
  nlohmann::ordered_json header = nlohmann::ordered_json::object();
  header[kMetadataKey] = metadata;
  nlohmann::ordered_json::object_t::Container& entries = header.get_ref<nlohmann::ordered_json::object_t&>();
  std::uint64_t begin = 0;
  for (const TensorToWrite& tensor : tensors) {
    const std::uint64_t end = begin + *tensor_bytes(tensor.dtype, tensor.shape);
    nlohmann::ordered_json entry = {
        {"dtype", tensor.dtype}, {"shape", tensor.shape}, {"data_offsets", {begin, end}}};
    entries.emplace_back(tensor.name, std::move(entry));
    begin = end;
  }
  std::string text = header.dump();
  text.resize((text.size() + 7) / 8 * 8, ' ');
  return text;
}

std::optional<std::uint64_t> tensor_bytes(const std::string& dtype, const std::vector<std::uint64_t>& shape) {
  std::uint64_t bytes = dtype_bytes(dtype);
  if (bytes == 0 || shape.size() > kMaxRank) return std::nullopt;
  for (const std::uint64_t size : shape) {
    if (__builtin_mul_overflow(bytes, size, &bytes)) return std::nullopt;
  }
  return bytes;
}

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

std::string checksum_digits(std::uint32_t checksum) { return hex_digits(checksum, kChecksumDigits); }

}  // namespace supertac::safetensors
