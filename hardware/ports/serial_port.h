// A serial port or pseudo-terminal: raw, exclusive, with monotonic deadlines and typed errors.
// Not libserialport: its version 0.1.1 refuses pseudo-terminals, of which the virtual rig is made.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "data/sensors/rig.h"
#include "hardware/ports/port.h"

namespace supertac {

/// Seconds of CLOCK_MONOTONIC.
double monotonic_seconds();

struct SerialSettings {
  unsigned baud = rig::kPrinterBaud;
  /// The port's clock runs this many times faster than the wall clock. 1 for everything real; a virtual rig
  /// started with `--speedup X` needs the same X here, so that all times below stay times of the rig.
  double speedup = 1;
};

class SerialPort : public Port {
 public:
  /// Opens `path` for this process alone: TIOCEXCL, and flock because root passes TIOCEXCL.
  /// DTR and RTS are raised where they exist. Nothing that has already arrived is thrown away.
  /// Throws PortNotFound, PortPermission, PortBusy, NotASerialPort, PortUnplugged; PortError where the system
  /// makes another baud rate of the one that was asked for.
  explicit SerialPort(const std::string& path, const SerialSettings& settings = {});
  ~SerialPort() override;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  const std::string& name() const override { return path_; }
  unsigned baud() const override;
  double now() override { return monotonic_seconds() * speedup_; }
  Received read(std::span<std::byte> buffer, double until) override;
  double write(std::span<const std::byte> bytes, double until) override;

 private:
  /// Waits for `events`; false when `until` passed. Throws PortUnplugged on POLLHUP without data.
  bool wait_for(short events, double until);
  [[noreturn]] void unplugged(const std::string& found) const;

  std::string path_, lasting_;  // lasting_: the name that it has wherever it is plugged in
  double speedup_;
  int descriptor_ = -1;
};

}  // namespace supertac
