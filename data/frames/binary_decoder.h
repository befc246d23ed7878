// Binary frames: header, time, values, checksum, trailer, each where the sensor has it.
#pragma once

#include <string>
#include <vector>

#include "data/frames/sensor_decoder.h"

namespace supertac {

/// Size in bytes of a number of this FrameFormat::type or FrameTime::type; and the number that begins at
/// `bytes`.
std::size_t bytes_of(const std::string& type);
double number_at(const std::byte* bytes, const std::string& type, bool big_endian);
/// The checksum `kind` (FrameFormat::checksum) of these bytes; and its size in a frame: 0 bytes for "none", 1
/// for "sum8" and "xor8", 2 for CRCs.
std::uint32_t checksum_of(const std::string& kind, std::span<const std::byte> bytes);
std::size_t checksum_bytes(const std::string& kind);

class BinaryDecoder : public SensorDecoder {
 public:
  explicit BinaryDecoder(const Sensor& sensor);
  void push(std::span<const std::byte> bytes, const Sink& sink) override;
  /// Bytes of a whole frame.
  std::size_t size() const { return size_; }

 private:
  bool is_frame(const std::byte* start) const;
  bool has_header(const std::byte* start, std::size_t left) const;
  /// Whether what stands at position_ is to be taken; nothing while more bytes must tell.
  std::optional<bool> accepts() const;
  void discard(std::size_t count);
  void hand_over(const std::byte* start, const Sink& sink);

  FrameFormat format_;
  std::size_t count_, size_, value_bytes_, values_at_;
  bool vague_;  // nothing behind the values tells a whole frame from a torn one
  std::vector<std::byte> buffer_;
  std::size_t position_ = 0;
  std::size_t discarded_ = 0;  // bytes since the last frame
  bool found_ = false;         // a frame ends at position_
  bool ever_ = false;          // there was one
  std::vector<float> values_;
};

}  // namespace supertac
