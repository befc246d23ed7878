#include "io/files/provenance.h"

#include <map>

#include "io/files/safetensors_header.h"
#include "io/numbers/sha256.h"

namespace supertac {
namespace {

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

}  // namespace

void set_provenance(std::string json) { stamp() = std::move(json); }
const std::string& provenance() { return stamp(); }

std::string content_hash(const SafetensorsFile& file) {
  std::map<std::string, std::string> metadata = file.metadata();
  metadata.erase(kProvenanceKey);
  const std::vector<TensorToWrite> tensors = tensors_of(file);
  const std::string text = safetensors::sealed_header(std::move(metadata), tensors);
  const std::uint64_t length = text.size();
  Sha256 hash;
  hash.add(std::as_bytes(std::span(&length, 1)));
  hash.add(text);
  for (const TensorToWrite& tensor : tensors) hash.add(tensor.data);
  return hash.hex();
}

}  // namespace supertac
