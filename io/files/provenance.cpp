#include "io/files/provenance.h"

#include <algorithm>

#include "io/files/safetensors_header.h"
#include "io/numbers/hash.h"
#include "io/numbers/sha256.h"

namespace supertac {
namespace {

std::string& stamp() {
  static std::string json;
  return json;
}

// In the order in which they lie in the file.
std::vector<TensorToWrite> tensors_of(const SafetensorsFile& file) {
  std::vector<std::pair<std::uint64_t, TensorToWrite>> order;
  for (const auto& [name, info] : file.tensors())
    order.push_back({info.begin, {name, info.dtype, info.shape, file.bytes(name)}});
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<TensorToWrite> tensors;
  for (auto& [begin, tensor] : order) tensors.push_back(std::move(tensor));
  return tensors;
}

}  // namespace

void set_provenance(std::string json) { stamp() = std::move(json); }
const std::string& provenance() { return stamp(); }

std::string content_hash(const SafetensorsFile& file) {
  using namespace safetensors;
  std::map<std::string, std::string> metadata = file.metadata();
  metadata.erase(kProvenanceKey);
  metadata[kFormatKey] = kFormatVersion;
  metadata[kChecksumKey] = std::string(kChecksumDigits, '0');
  const std::vector<TensorToWrite> tensors = tensors_of(file);
  std::string text = header_text(metadata, tensors);
  std::uint32_t sum = crc32(std::as_bytes(std::span(text)));
  for (const TensorToWrite& tensor : tensors) sum = crc32(tensor.data, sum);
  text.replace(*checksum_position(text), kChecksumDigits, checksum_digits(sum));
  const std::uint64_t length = text.size();
  Sha256 hash;
  hash.add(std::as_bytes(std::span(&length, 1)));
  hash.add(text);
  for (const TensorToWrite& tensor : tensors) hash.add(tensor.data);
  return hash.hex();
}

}  // namespace supertac
