// A safetensors file in memory, to be changed and written again.
#pragma once

#include "io/files/safetensors.h"
#include "tests/support/test.h"

namespace supertac {

struct TensorFile {
  struct Entry {
    std::string name, dtype;
    std::vector<std::uint64_t> shape;
    std::vector<std::byte> bytes;
  };

  explicit TensorFile(const SafetensorsFile& file) : metadata(file.metadata()) {
    for (const auto& [name, info] : file.tensors()) {
      const auto bytes = file.bytes(name);
      tensors.push_back({name, info.dtype, info.shape, {bytes.begin(), bytes.end()}});
    }
    std::ranges::sort(tensors, {}, [&](const Entry& t) { return file.tensors().at(t.name).begin; });
    for (const char* own : {"supertac_format", "checksum"}) metadata.erase(own);
  }
  /// With a checksum of its own.
  void write(const std::string& path) const {
    std::vector<TensorToWrite> written;
    for (const Entry& t : tensors) written.push_back({t.name, t.dtype, t.shape, t.bytes});
    write_safetensors(path, metadata, written);
  }

  std::map<std::string, std::string> metadata;
  std::vector<Entry> tensors;  ///< in the order of the file
};

}  // namespace supertac
