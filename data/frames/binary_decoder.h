// Binary frames: header, fields, checksum, trailer, each where the sensor has it.
#pragma once

#include <string>
#include <vector>

#include "data/frames/sensor_decoder.h"

namespace supertac {

/// The `count` bytes that begin at `bytes`, 8 at most, as one whole number.
std::uint64_t bits_at(const std::byte* bytes, std::size_t count, bool big_endian);
/// Size in bytes of a number of this FrameFormat::type or FrameTime::type; and the number that begins at
/// `bytes`.
std::size_t bytes_of(const std::string& type);
double number_at(const std::byte* bytes, const std::string& type, bool big_endian);
/// The checksum `kind` (kChecksums) of these bytes; and its size in a frame: 0 bytes for "none".
std::uint32_t checksum_of(const std::string& kind, std::span<const std::byte> bytes);
std::size_t checksum_bytes(const std::string& kind);

/// Where what stands in a frame of this format, in bytes from its first. `count` values, in runs.
struct BinaryLayout {
  struct Run {
    std::size_t at = 0, count = 0;
  };
  BinaryLayout(const FrameFormat& format, std::size_t count);
  std::size_t time_at = 0, checksum_at = 0, size = 0;
  std::vector<Run> runs;
};

/// Where one frame ends the next begins. Where that fails it is looked for anew: frames with a checksum or a
/// trailer are taken as they are; else the place counts whose header returns a frame later the most often, of
/// up to eight frames. So values that hold the header's bytes cost no frame.
class BinaryDecoder : public SensorDecoder {
 public:
  explicit BinaryDecoder(const Sensor& sensor) : BinaryDecoder(sensor.frame, sensor.values(), false) {}
  void push(std::span<const std::byte> bytes, const Sink& sink) override;
  /// Bytes of a whole frame.
  std::size_t size() const { return layout_.size; }
  /// Bytes kept for the next push().
  std::size_t pending() const { return buffer_.size() - position_; }

 protected:
  /// `certain`: is_frame() alone tells a frame, wherever it stands.
  BinaryDecoder(const FrameFormat& format, std::size_t values, bool certain);
  virtual bool is_frame(const std::byte* start) const;
  virtual void hand_over(const std::byte* start, const Sink& sink);
  /// Bytes before the frame that is handed over, back to the one before, that were none.
  std::size_t discarded() const { return discarded_; }

 private:
  bool has_header(const std::byte* start, std::size_t left) const;
  /// Whether what stands at position_ is to be taken; nothing while more bytes must tell.
  std::optional<bool> accepts() const;
  /// Looks for a frame by its headers alone; false while more bytes must tell.
  bool search();
  /// How often the header stands at place + n size in turn, up to kMostReturns; whether it may go on.
  std::pair<std::size_t, bool> returns(std::size_t place) const;
  void discard(std::size_t count);

  FrameFormat format_;
  std::size_t value_bytes_;
  BinaryLayout layout_;
  bool certain_, vague_;  // vague: nothing behind the values tells a whole frame from a torn one
  std::vector<std::byte> buffer_;
  std::size_t position_ = 0;
  std::size_t discarded_ = 0;  // bytes since the last frame
  std::size_t expected_ = 0;   // where the next frame would have begun, from position_
  bool found_ = false;         // a frame ends at position_
  bool ever_ = false;          // there was one
  std::vector<float> values_;
};

}  // namespace supertac
