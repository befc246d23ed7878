// A model for other runtimes: as an ONNX file; as C99 for microcontrollers, with the chain of SHA-256 hashes
// that leads from recordings to a picture on one (docs/audit.md).
#pragma once

#include <string>
#include <vector>

#include "models/files/model_file.h"

namespace supertac {

/// The bytes of an ONNX file. The model takes "volts" [N,T,signals] in the sensor's unit, each sample the
/// mean of the signals over a period of the model's rate; scaling and normalisation are part of the graph. It
/// draws "picture" [N,height,width] and, where the network has it, "predicted_error", the same shape, of
/// which interval.h makes 90 % intervals by `interval_factor` of the metadata. The file's metadata are those
/// of the model. The ops are those of one traced inference (autograd/trace.h). Throws std::logic_error naming
/// an op that has no counterpart.
std::string onnx_of(const ModelFile& model);

/// What something was made of, by its SHA-256.
struct ChainLink {
  std::string name, hash;  ///< lower-case hexadecimal digits
};

struct CCode {
  std::string header, source;
  std::vector<ChainLink> chain;                  ///< what was given, and "code" and "picture" (exported())
  std::size_t weight_bytes = 0, work_bytes = 0;  ///< bytes of flash and of RAM
};

/// The network in int8 (models/inference/compiled/integer_plan.h) and the live preprocessing before it
/// (data/windows/live_window.h), as NAME.h and NAME.c: weights in flash, one work area of constant size, no
/// heap, memcpy alone of the C library. NAME_push_at() and NAME_picture() draw the bits of supertac-stream
/// --precision int8, NAME_draw() those of an int8 CompiledModel. `name`: an identifier of C. `sensor_hz`:
/// frames a second, 1 to 100,000. `chain`: what it is made of, which the header states, with its own links.
/// Throws std::invalid_argument for another name or rate, std::runtime_error for a model without the ranges
/// that int8 needs, or a layer that is too large.
CCode c_code_of(const ModelFile& file, const std::string& name, double sensor_hz,
                std::vector<ChainLink> chain = {});

// In chain.cpp:
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
