#include "io/safetensors_header.h"

#include <limits>
#include <set>

#include "io/json.h"
#include "io/text.h"

namespace supertac::safetensors {
namespace {

// {"__metadata__": {text: text}, name: {"dtype": text, "shape": [n...], "data_offsets": [begin, end]}, ...}
// Each callback checks that its value may stand where it stands, so the deepest nesting is three.
class HeaderParser : public JsonHandler {
 public:
  Header take() { return std::move(header_); }

  bool start_object(std::size_t) override {
    if (place_ == Place::outside) return enter(Place::file);
    if (place_ != Place::file) return refuse("unexpected object in " + in_quotes(entry_));
    if (entry_ == kMetadataKey) return enter(Place::metadata);
    if (header_.tensors.size() == kMaxTensors) {
      return refuse("more than " + std::to_string(kMaxTensors) + " tensors");
    }
    tensor_ = {};
    offsets_.clear();
    return enter(Place::tensor);
  }

  bool key(std::string& name) override {
    if (place_ == Place::file) {
      if (!entries_.insert(name).second) return refuse("the name " + in_quotes(name) + " appears twice");
      entry_ = name;
      fields_.clear();
      return true;
    }
    if (!fields_.insert(name).second)
      return refuse(in_quotes(name) + " appears twice in " + in_quotes(entry_));
    if (fields_.size() > kMaxFields)
      return refuse("more than " + std::to_string(kMaxFields) + " metadata fields");
    field_ = name;
    return true;
  }

  bool string(std::string& value) override {
    if (place_ == Place::metadata) {
      header_.metadata.emplace(field_, value);
      return true;
    }
    if (place_ != Place::tensor || field_ != "dtype") return unexpected("a string");
    tensor_.dtype = value;
    return true;
  }

  bool start_array(std::size_t) override {
    if (place_ != Place::tensor) return unexpected("an array");
    if (field_ == "shape") return enter(Place::shape);
    if (field_ == "data_offsets") return enter(Place::offsets);
    return unexpected("an array");
  }

  bool number_unsigned(std::uint64_t value) override {
    if (place_ != Place::shape && place_ != Place::offsets) return unexpected("a number");
    auto& list = place_ == Place::shape ? tensor_.shape : offsets_;
    const std::size_t longest = place_ == Place::shape ? kMaxRank : 2;
    if (list.size() == longest) {
      return refuse(in_quotes(entry_) + ": more than " + std::to_string(longest) + " numbers in " +
                    in_quotes(field_));
    }
    list.push_back(value);
    return true;
  }

  bool end_array() override { return enter(Place::tensor); }

  bool end_object() override {
    if (place_ == Place::metadata) return enter(Place::file);
    if (place_ == Place::file) return enter(Place::outside);
    if (fields_ != std::set<std::string>{"data_offsets", "dtype", "shape"} || offsets_.size() != 2) {
      return refuse("tensor " + in_quotes(entry_) +
                    " needs exactly dtype, shape and data_offsets [begin, end]");
    }
    tensor_.begin = offsets_[0];
    tensor_.end = offsets_[1];
    header_.tensors.emplace(entry_, std::move(tensor_));
    return enter(Place::file);
  }

 private:
  enum class Place { outside, file, metadata, tensor, shape, offsets };

  bool enter(Place place) {
    place_ = place;
    return true;
  }

  bool unexpected(const std::string& what) {
    return refuse("unexpected " + what + " in " + in_quotes(entry_) +
                  (field_.empty() ? "" : " at " + in_quotes(field_)));
  }

  Header header_;
  Place place_ = Place::outside;
  std::set<std::string> entries_;
  std::set<std::string> fields_;
  std::string entry_;
  std::string field_;
  TensorInfo tensor_{};
  std::vector<std::uint64_t> offsets_;
};

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
  HeaderParser parser;
  parse_json(text, parser);
  return parser.take();
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

std::string checksum_digits(std::uint32_t checksum) {
  std::string digits(kChecksumDigits, '0');
  for (std::size_t i = kChecksumDigits; i-- > 0; checksum >>= 4)
    digits[i] = "0123456789abcdef"[checksum & 15];
  return digits;
}

}  // namespace supertac::safetensors
