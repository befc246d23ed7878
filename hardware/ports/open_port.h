// Where a sensor's bytes come from, by address.
#pragma once

#include <memory>
#include <string>

#include "data/sensors/sensor.h"
#include "hardware/ports/port.h"

namespace supertac {

struct OpenedPort {
  std::unique_ptr<Port> port;
  bool live = true;     ///< the sender does not wait: a serial line or a socket, not a file or a pipe
  bool stored = false;  ///< a file: when its bytes arrive says nothing
};

/// s: who waits for bytes looks after so long whether to go on.
constexpr double kReadSlice = 0.05;

/// `serial:DEVICE@BAUD` ("auto" finds the rig's board), udp:[HOST]:PORT (listens), tcp:HOST:PORT (connects,
/// at most 5 s), "-" for standard input, or the path of a file or FIFO. `lines`: a datagram ends a line.
/// `speedup` as SerialSettings. Throws PortError and its kinds.
OpenedPort open_port(const std::string& address, bool lines = false, double speedup = 1);
/// The port that a sensor's file names.
OpenedPort open_port(const Sensor& sensor, double speedup = 1);

}  // namespace supertac
