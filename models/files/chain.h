// The chain of SHA-256 hashes that leads from recordings to a picture on a microcontroller (docs/audit.md).
#pragma once

#include <string>
#include <vector>

#include "models/files/c_code.h"

namespace supertac {

/// The links that a model file holds, in their order, those of its provenance as far as it states them:
///   recordings        what it was trained on (hash_of_recordings())
///   recipe            the metadata but for checksum and provenance: keys in ascending order and their
///                     texts, each ended by a byte 0
///   model             the tensors but for those of int8, in ascending order of their names: the name, ended
///                     by a byte 0, and its bytes
std::vector<ChainLink> chain_of(const SafetensorsFile& file);

/// The model of a file as C99 (c_code_of()), and the whole chain to it: chain_of() and
///   int8              the ranges of the model's values, and all weights, scales and shifts made of them
///   code              NAME.c
///   picture           of NAME_self_test(), the first 16 digits
/// `sensor_hz` 0: the model's rate. Throws as load_model() and c_code_of().
CCode exported(const SafetensorsFile& file, const std::string& name, double sensor_hz);

}  // namespace supertac
