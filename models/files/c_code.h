// A model as C99 for microcontrollers.
#pragma once

#include <string>

#include "models/files/model_file.h"

namespace supertac {

struct CCode {
  std::string header, source;
  std::size_t weight_bytes = 0, work_bytes = 0;  ///< of flash and of RAM
};

/// The network in whole numbers (models/inference/prepared/integer_plan.h) and what stands before it when it
/// is live (data/windows/live_window.h), as NAME.h and NAME.c: weights in flash, one work area of constant
/// size, no heap, of the C library memcpy alone. NAME_picture() after NAME_push_at() of a recording's frames
/// draws the bits that supertac-stream --precision int8 draws of it, NAME_draw() those of a Prepared network.
/// `name`: an identifier of C. `sensor_hz`: of the frames; `written_by`: for the comment at the top. Throws
/// std::invalid_argument for another name or rate, std::runtime_error for a model without the ranges that
/// int8 needs.
CCode c_code_of(const ModelFile& file, const std::string& name, double sensor_hz,
                const std::string& written_by);

}  // namespace supertac
