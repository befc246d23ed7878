// A model as C99 for microcontrollers.
#pragma once

#include <string>
#include <vector>

#include "models/files/model_file.h"

namespace supertac {

/// What something was made of, by its SHA-256 (models/files/chain.h).
struct ChainLink {
  std::string name, hash;  ///< lower-case hexadecimal digits
};

struct CCode {
  std::string header, source;
  std::vector<ChainLink> chain;  ///< what was given, and "code" and "picture" (models/files/chain.h)
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

}  // namespace supertac
