// Provenance: what a file says of how it was made, in its metadata as JSON. It does not count as content: two
// files with equal content hashes hold the same.
#pragma once

#include <string>

#include "io/files/safetensors.h"

namespace supertac {

inline constexpr char kProvenanceKey[] = "provenance";

/// Every safetensors file that this process writes from now on says `json` in its field "provenance"; ""
/// ends this, and libraries begin so. Not to be called while files are written.
void set_provenance(std::string json);
const std::string& provenance();

/// SHA-256, in hexadecimal digits, of the file as write_safetensors() writes it without provenance: of one
/// that has none it is what sha256sum says.
std::string content_hash(const SafetensorsFile& file);

}  // namespace supertac
