// Binary frames: header, fields, checksum, trailer, each where the sensor has it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "data/frames/sensor_decoder.h"
#include "data/sensors/rig.h"

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

/// Where one frame ends the next begins. Where that fails it is looked for anew: frames with a checksum or a
/// trailer are taken as they are; else the place counts whose header returns a frame later the most often, of
/// up to eight frames. So values that hold the header's bytes cost no frame.
class BinaryDecoder : public SensorDecoder {
 public:
  explicit BinaryDecoder(const Sensor& sensor) : BinaryDecoder(sensor.frame, sensor.values(), false) {}
  void push(std::span<const std::byte> bytes, const Sink& sink) override;
  /// Bytes of a whole frame.
  std::size_t size() const { return size_; }
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
  // Where what stands, in bytes from a frame's first; values in runs, by their begin.
  std::size_t time_at_ = 0, checksum_at_ = 0, size_ = 0;
  std::vector<std::pair<std::size_t, std::size_t>> runs_ = {};
  bool certain_, vague_;  // vague: nothing behind the values tells a whole frame from a torn one
  std::vector<std::byte> buffer_;
  std::size_t position_ = 0;
  std::size_t discarded_ = 0;  // bytes since the last frame
  std::size_t expected_ = 0;   // where the next frame would have begun, from position_
  bool found_ = false;         // a frame ends at position_
  bool ever_ = false;          // there was one
  std::vector<float> values_;
};

/// One frame of the tactile board, to the byte. 164 bytes: 0x24, 80 big-endian samples, one auxiliary (slip)
/// sample, 0x21; no length, no counter, no checksum. The ADC has 12 bits, so all 81 high bytes are <= 0x0F.
/// Sample n belongs to patch n % 5 and taxel k = n / 5; the rig's finger is patch 0. Here as in data/, taxel
/// k lies in row k / 4 (along y) and column k % 4 (along x). The board's firmware names them the other way
/// round: it scans "columns", which are our rows.
struct BoardFrame {
  std::array<std::uint16_t, rig::kFrameSamples> samples{};
  std::uint16_t slip = 0;
  bool operator==(const BoardFrame&) const = default;

  /// ADC value of the finger's taxel k.
  std::uint16_t taxel(int k) const {
    return samples[std::size_t{rig::kPatches} * static_cast<std::size_t>(k)];
  }
};

/// Writes the 164 bytes of `frame`. Throws std::invalid_argument for a sample above 4095.
void write_frame(const BoardFrame& frame, std::span<std::byte, rig::kFrameBytes> out);

/// Finds the board's frames in its byte stream: a header, 81 high bytes <= 0x0F and a trailer. On a failed
/// check it looks again from the NEXT BYTE: at 1e-3 dropped bytes a reader that skips whole frames loses
/// 16-87 % of the undamaged ones, this one none. Values are the finger's taxels in volts, rig::volts_of() in
/// single precision. Bytes between two whole frames count as damaged frames; a byte or two too many or too
/// few are a cable's errors.
///
/// A flipped bit inside a sample passes every check of the format. DecodedFrame::jump flags a taxel that
/// moves more than 124 ADC steps, 0.1 V, between two frames, in which the finger moves 0.01 mm at 10 mm/s;
/// three such frames in a row are a change of the world.
class BoardDecoder : public BinaryDecoder {
 public:
  BoardDecoder();
  /// The one that was handed over last.
  const BoardFrame& frame() const { return frame_; }

 private:
  bool is_frame(const std::byte* start) const override;
  void hand_over(const std::byte* start, const Sink& sink) override;
  bool jumps();

  BoardFrame frame_;
  std::array<int, rig::kTaxels> before_{};  // the taxels of the last frame that was no jump
  int jumps_ = 0;                           // frames in a row that were
  bool first_ = true;
};

}  // namespace supertac
