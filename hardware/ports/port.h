// A byte stream with a clock: the only door between the drivers and the world. SerialPort, the descriptors
// of open_port.cpp (UDP, TCP, files), CapturedPort, ReplayPort (of a sensor) and the simulated ports of the
// tests are all behind it, so that every line of the drivers runs the same on a real rig and in simulated
// time.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace supertac {

struct Sensor;

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

  /// The path or address, for messages.
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
  /// Throws PortTimeout when the device does not take them by `until`, PortUnplugged when it is gone,
  /// PortError where the port is only read.
  virtual double write(std::span<const std::byte> bytes, double until) = 0;
};

struct OpenedPort {
  std::unique_ptr<Port> port;
  bool live = true;     ///< the sender does not wait: a serial line or a socket, not a file or a pipe
  bool stored = false;  ///< a file: when its bytes arrive says nothing
};

/// s: who waits for bytes looks after so long whether to go on.
constexpr double kReadSlice = 0.05;

/// `serial:DEVICE@BAUD` ("auto" finds the rig's board), udp:[HOST]:PORT (listens), tcp:HOST:PORT (connects),
/// "-" for standard input, or the path of a file or FIFO. A name server gets 5 s, a host that does not answer
/// as many. `lines`: a datagram ends a line. `speedup` as SerialSettings. Throws PortError and its kinds.
OpenedPort open_port(const std::string& address, bool lines = false, double speedup = 1);
/// The port that a sensor's file names.
OpenedPort open_port(const Sensor& sensor, double speedup = 1);

}  // namespace supertac
