#include "io/files/safetensors.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <stdexcept>

#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors_header.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

using namespace safetensors;

std::string& stamp() {
  static std::string json;
  return json;
}

// In the order in which they lie in the file.
std::vector<TensorToWrite> tensors_of(const SafetensorsFile& file) {
  std::multimap<std::uint64_t, TensorToWrite> order;
  for (const auto& [name, info] : file.tensors())
    order.emplace(info.begin, TensorToWrite{name, info.dtype, info.shape, file.bytes(name)});
  std::vector<TensorToWrite> tensors;
  for (auto& [begin, tensor] : order) tensors.push_back(std::move(tensor));
  return tensors;
}

[[noreturn]] void refuse(const std::string& path, const std::string& problem) {
  throw FileError(path, "not a safetensors file that can be read: " + problem);
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

// Tensors, ordered by their place, must tile [0, data_bytes) exactly.
void check_layout(const std::string& path, const std::map<std::string, TensorInfo>& tensors,
                  std::uint64_t data_bytes) {
  std::vector<std::pair<const std::string*, const TensorInfo*>> order;
  for (const auto& [name, info] : tensors) {
    const auto bytes = tensor_bytes(info.dtype, info.shape);
    if (!bytes)
      refuse(path,
             "tensor " + in_quotes(name) + " has unknown type " + in_quotes(info.dtype) + " or is too large");
    if (info.end < info.begin || info.end - info.begin != *bytes) {
      refuse(path, "tensor " + in_quotes(name) + " spans bytes " + std::to_string(info.begin) + " to " +
                       std::to_string(info.end) + ", its shape and type need " + std::to_string(*bytes));
    }
    order.emplace_back(&name, &info);
  }
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    return std::pair(a.second->begin, a.second->end) < std::pair(b.second->begin, b.second->end);
  });
  std::uint64_t next = 0;
  for (const auto& [name, info] : order) {
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
  const std::string found = checksum_digits(crc32(data, crc32(std::as_bytes(std::span(text)))));
  if (found != stored->second) {
    refuse(path, "checksum " + found + ", expected " + in_quotes(stored->second) +
                     "; it is damaged, or another program changed it and kept our checksum");
  }
  return true;
}

void hand_over(const TensorToWrite& tensor, const ByteSink& sink) {
  if (tensor.read) {
    tensor.read(sink);
  } else {
    sink(tensor.data);
  }
}

std::uint32_t checksum_of(const std::string& header, std::span<const TensorToWrite> tensors) {
  std::uint32_t sum = crc32(std::as_bytes(std::span(header)));
  for (const TensorToWrite& tensor : tensors) {
    std::uint64_t bytes = 0;
    hand_over(tensor, [&](std::span<const std::byte> piece) {
      sum = crc32(piece, sum);
      bytes += piece.size();
    });
    const std::uint64_t expected = *tensor_bytes(tensor.dtype, tensor.shape);
    if (bytes != expected) {
      throw std::invalid_argument("write_safetensors: tensor " + in_quotes(tensor.name) + " has " +
                                  std::to_string(bytes) + " bytes, its shape and type need " +
                                  std::to_string(expected));
    }
  }
  return sum;
}

void check_writable(const std::map<std::string, std::string>& metadata,
                    const std::vector<TensorToWrite>& tensors) {
  const auto wrong = [](const std::string& problem) {
    throw std::invalid_argument("write_safetensors: " + problem);
  };
  for (const char* key : {kFormatKey, kChecksumKey}) {
    if (metadata.contains(key))
      wrong("the metadata field " + in_quotes(key) + " is written by this function");
  }
  if (metadata.size() + 2 > kMaxFields)
    wrong(std::to_string(metadata.size()) + " metadata fields are too many");
  if (tensors.size() > kMaxTensors) {
    wrong(std::to_string(tensors.size()) + " tensors, expected at most " + std::to_string(kMaxTensors));
  }
  std::set<std::string> names = {kMetadataKey};
  for (const TensorToWrite& tensor : tensors) {
    if (!names.insert(tensor.name).second) wrong("the name " + in_quotes(tensor.name) + " is taken");
    const auto bytes = tensor_bytes(tensor.dtype, tensor.shape);
    if (!bytes)
      wrong("tensor " + in_quotes(tensor.name) + " has unknown type " + in_quotes(tensor.dtype) + " or size");
  }
}

}  // namespace

std::string safetensors::sealed_header(std::map<std::string, std::string> metadata,
                                       std::span<const TensorToWrite> tensors) {
  metadata[kFormatKey] = kFormatVersion;
  metadata[kChecksumKey] = std::string(kChecksumDigits, '0');
  std::string text = header_text(metadata, tensors);
  text.replace(*checksum_position(text), kChecksumDigits, checksum_digits(checksum_of(text, tensors)));
  return text;
}

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
  std::string names;
  for (const auto& [other, _] : tensors_) {
    if (names.size() > 200) {
      names += ", ...";
      break;
    }
    names += (names.empty() ? "" : ", ") + in_quotes(other);
  }
  throw FileError(path_,
                  "has no tensor " + in_quotes(name) + " (it has: " + (names.empty() ? "none" : names) + ")");
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
    text = sealed_header(std::move(metadata), tensors);
  } catch (const nlohmann::json::exception&) {
    throw std::invalid_argument("write_safetensors: a name or metadata field is not valid UTF-8");
  }
  if (text.size() > kMaxHeaderBytes) {
    throw std::invalid_argument("write_safetensors: the header has " + std::to_string(text.size()) +
                                " bytes, expected at most " + std::to_string(kMaxHeaderBytes));
  }

  const std::uint64_t length = text.size();
  AtomicFile file(output);
  file.write(std::as_bytes(std::span(&length, 1)));
  file.write(text);
  for (const TensorToWrite& tensor : tensors) {
    hand_over(tensor, [&file](std::span<const std::byte> piece) { file.write(piece); });
  }
  file.commit();
}

void set_provenance(std::string json) { stamp() = std::move(json); }
const std::string& provenance() { return stamp(); }

std::string content_hash(const SafetensorsFile& file) {
  std::map<std::string, std::string> metadata = file.metadata();
  metadata.erase(kProvenanceKey);
  const std::vector<TensorToWrite> tensors = tensors_of(file);
  const std::string text = sealed_header(std::move(metadata), tensors);
  const std::uint64_t length = text.size();
  Sha256 hash;
  hash.add(std::as_bytes(std::span(&length, 1)));
  hash.add(text);
  for (const TensorToWrite& tensor : tensors) hash.add(tensor.data);
  return hash.hex();
}

std::string shape_text(const std::vector<std::uint64_t>& shape) { return "[" + joined(shape) + "]"; }

std::string value_or(const std::map<std::string, std::string>& metadata, const std::string& key,
                     const std::string& otherwise) {
  const auto found = metadata.find(key);
  return found == metadata.end() ? otherwise : found->second;
}

}  // namespace supertac
