// The one format for everything with arrays - recordings, data sets, checkpoints: safetensors
// (https://huggingface.co/docs/safetensors): 8 bytes header length (little-endian), a JSON header, the data.
// Ours carry two more fields in the header's __metadata__:
//   supertac_format  version of this layout, "1"
//   checksum         CRC-32 of header and data as 8 hexadecimal digits, with these digits taken as '0'
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "io/files/file.h"

namespace supertac {

struct TensorInfo {
  std::string dtype;                 // "F32", "F64", "U8", "I64", ... as in the format's documentation
  std::vector<std::uint64_t> shape;  // row-major
  std::uint64_t begin, end;          // bytes within the data
};

/// A file read and checked as a whole.
class SafetensorsFile {
 public:
  /// Throws FileError when the file cannot be read or breaks a rule. Rules: the header has at most 1 MiB,
  /// starts with '{' and is padded with spaces only; at most 8,192 tensors and 4,096 metadata fields;
  /// nothing nested deeper, no key twice, no field unknown; integers without sign, fraction or overflow; each
  /// tensor's bytes are those of its shape and type; tensors follow each other without gap or overlap up to
  /// the end of the file; version and checksum are right where there are any, and a file with one of them has
  /// both. No size is believed before it has been compared with the bytes the file has. A hostile header
  /// costs less than 10 ms.
  static SafetensorsFile read(const std::string& path);
  /// The same of a file that is in memory; `name` stands for its path.
  static SafetensorsFile of(std::span<const std::byte> bytes, const std::string& name);

  const std::string& path() const { return path_; }
  /// Without the two fields of this layer.
  const std::map<std::string, std::string>& metadata() const { return metadata_; }
  const std::map<std::string, TensorInfo>& tensors() const { return tensors_; }
  /// False: written by another program, damage cannot be seen. A wrong one does not load.
  bool has_checksum() const { return has_checksum_; }

  /// A tensor's bytes, or its elements when it has that type. Throw FileError when there is no such tensor
  /// (the message lists those there are) or it has another type.
  std::span<const std::byte> bytes(const std::string& name) const;
  std::vector<float> f32(const std::string& name) const;
  std::vector<double> f64(const std::string& name) const;

 private:
  static SafetensorsFile parsed(const std::string& path, std::uint64_t size,
                                const std::function<void(std::span<std::byte>)>& take);
  const TensorInfo& info(const std::string& name) const;
  template <class Element>
  std::vector<Element> elements(const std::string& name, const char* dtype) const;

  std::string path_;
  std::map<std::string, std::string> metadata_;
  std::map<std::string, TensorInfo> tensors_;
  std::vector<std::byte> data_;
  bool has_checksum_ = false;
};

/// "[2,3,40]".
std::string shape_text(const std::vector<std::uint64_t>& shape);

/// A field of the metadata, or `otherwise` where there is none.
std::string value_or(const std::map<std::string, std::string>& metadata, const std::string& key,
                     const std::string& otherwise = "");

using ByteSink = std::function<void(std::span<const std::byte>)>;

struct TensorToWrite {
  std::string name;
  std::string dtype;
  std::vector<std::uint64_t> shape;
  std::span<const std::byte> data;  // little-endian, row-major
  // Instead of `data`, for what is too large for memory: hands over all bytes in pieces, front to back.
  // Called twice, for the checksum and for the file.
  std::function<void(const ByteSink&)> read = {};
};

/// Writes the file atomically (io/files/file.h), with version and checksum; the same arguments give the same
/// bytes. Throws std::invalid_argument when bytes and shape disagree, a name appears twice or is
/// "__metadata__", a dtype is unknown, the metadata holds a field of this layer, a text is no UTF-8, or a cap
/// of read() would be exceeded; FileError when the file cannot be written.
void write_safetensors(const OutputPath& output, std::map<std::string, std::string> metadata,
                       const std::vector<TensorToWrite>& tensors);

// Provenance: what a file says of how it was made, in its metadata as JSON. It does not count as content: two
// files with equal content hashes hold the same.

inline constexpr char kProvenanceKey[] = "provenance";

/// Every safetensors file that this process writes from now on says `json` in its field "provenance"; ""
/// ends this, and libraries begin so. Not to be called while files are written.
void set_provenance(std::string json);
const std::string& provenance();

/// SHA-256, in hexadecimal digits, of the file as write_safetensors() writes it without provenance: of one
/// that has none it is what sha256sum says.
std::string content_hash(const SafetensorsFile& file);

}  // namespace supertac
