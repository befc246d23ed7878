// What the signals are called in files.
#pragma once

#include "data/sensors/sensor.h"
#include "io/files/safetensors.h"

namespace supertac {

/// The tensor that holds the signals of a recording or a log of pictures: "volts" where they are volts,
/// "signals" of any other unit; until 0.2 "volts" of all, and read so for ever.
inline const char* signals_tensor(const SignalScale& scale) {
  return scale.unit == "V" ? "volts" : "signals";
}
/// Which of the two a file has.
inline const char* signals_tensor(const SafetensorsFile& file) {
  return file.tensors().contains("signals") ? "signals" : "volts";
}

}  // namespace supertac
