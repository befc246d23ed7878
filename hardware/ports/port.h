// A byte stream with a clock: the only door between the drivers and the world. SerialPort, CapturedPort,
// ReplayPort and the simulated ports of the virtual rig are all behind it, so that every line of the
// drivers runs the same on a real rig, on a replay and in simulated time.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace supertac {

/// Printable, or a line break: a firmware says little else, a board's frames are mostly something else.
constexpr bool is_text(std::byte byte) {
  const int c = std::to_integer<int>(byte);
  return c == '\n' || c == '\r' || (c >= ' ' && c < 127);
}

/// What a read brought: `count` bytes (0: the deadline passed) that had arrived by `time_s`.
struct Received {
  std::size_t count = 0;
  double time_s = 0;
};

class Port {
 public:
  virtual ~Port() = default;

  /// The path, for messages.
  virtual const std::string& name() const = 0;

  /// Of a serial line, as the system has set it; 0 where there is none.
  virtual unsigned baud() const { return 0; }

  /// Seconds on the port's monotonic clock. All deadlines below are points on it.
  virtual double now() = 0;

  /// Waits until at least one byte has arrived or the clock reads `until` and returns what is there;
  /// `until <= now()` polls. A time-out is count 0.
  /// Throws PortUnplugged at end of file; the two are never confused.
  virtual Received read(std::span<std::byte> buffer, double until) = 0;

  /// Writes all bytes, returns the time at which the last one was handed over.
  /// Throws PortTimeout when the device does not take them by `until`, PortUnplugged when it is gone.
  virtual double write(std::span<const std::byte> bytes, double until) = 0;
};

}  // namespace supertac
