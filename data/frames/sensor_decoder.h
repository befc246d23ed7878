// From a sensor's bytes to frames, whatever they are written in. A decoder knows no port and no clock.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "data/sensors/sensor.h"

namespace supertac {

/// One frame as its sensor sent it, valid during the call that hands it over.
struct DecodedFrame {
  std::span<const float> values;  ///< as many as Sensor::values(), in the order of the frame
  std::optional<double> time_s;   ///< of the sensor's clock, where it sends one
  std::uint32_t damaged = 0;      ///< frames between the one before and this one that came, but not whole
  bool suspect = false;           ///< it stands behind bytes that were no frame
  bool jump = false;              ///< implausible change of a taxel (BoardDecoder)
};

class SensorDecoder {
 public:
  using Sink = std::function<void(const DecodedFrame&)>;
  struct Counters {
    std::uint64_t bytes = 0, frames = 0;
    std::uint64_t torn = 0;             ///< lines, or runs of bytes, that were no frame
    std::uint64_t discarded_bytes = 0;  ///< of these
  };

  virtual ~SensorDecoder() = default;
  /// Takes the next bytes and hands over every frame that they complete.
  virtual void push(std::span<const std::byte> bytes, const Sink& sink) = 0;
  const Counters& counters() const { return counters_; }

 protected:
  Counters counters_;
};

/// Looks again from the next line, or the next byte, where something is no frame: at 1e-3 lost bytes all
/// undamaged frames come through. In text and JSON a number that lost a digit cannot be told from a right
/// one.
std::unique_ptr<SensorDecoder> make_decoder(const Sensor& sensor);

/// All numbers of a JSON value, nested arrays in turn, null as NaN; false when it holds anything else.
bool flatten(const nlohmann::ordered_json& json, std::vector<float>& numbers);

}  // namespace supertac
