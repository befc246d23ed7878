// The header of a safetensors file: rules, parsing and writing. Internal to io/files/safetensors.*.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "io/files/safetensors.h"

namespace supertac::safetensors {

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

/// The header's JSON, checked for itself. Throws JsonError.
Header parse_header(std::string_view text);

/// JSON text, padded with spaces so that the data begins at a multiple of 8 bytes. Types and shapes must be
/// good.
std::string header_text(const std::map<std::string, std::string>& metadata,
                        std::span<const TensorToWrite> tensors);

/// The same with version and checksum: what stands in the file. Throws std::invalid_argument for a tensor
/// with other bytes than its shape and type need.
std::string sealed_header(std::map<std::string, std::string> metadata,
                          std::span<const TensorToWrite> tensors);

/// Size of a tensor in bytes; nullopt for an unknown dtype, a rank over kMaxRank, or a product beyond 64
/// bits.
std::optional<std::uint64_t> tensor_bytes(const std::string& dtype, const std::vector<std::uint64_t>& shape);

/// Where the digits of the checksum stand in the header's text; nullopt when there are none.
std::optional<std::size_t> checksum_position(std::string_view text);

std::string checksum_digits(std::uint32_t checksum);

}  // namespace supertac::safetensors
