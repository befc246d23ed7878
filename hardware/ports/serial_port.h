// A serial port or pseudo-terminal: raw, exclusive, with monotonic deadlines and typed errors; and which USB
// serial ports there are, from sysfs.
// Not libserialport: its version 0.1.1 refuses pseudo-terminals, of which the virtual rig is made.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "data/sensors/rig.h"
#include "hardware/ports/port.h"

namespace supertac {

/// Seconds of CLOCK_MONOTONIC.
double monotonic_seconds();

/// Waits until a descriptor is ready for `events` of poll(), or its other side has gone: the next read or
/// write says which. False when `seconds` passed or a signal came first.
bool wait_for(int descriptor, short events, double seconds);

struct SerialSettings {
  unsigned baud = rig::kPrinterBaud;
  /// The port's clock runs this many times faster than the wall clock. 1 for everything real; a virtual rig
  /// started with `--speedup X` needs the same X here, so that all times below stay times of the rig.
  double speedup = 1;
};

class SerialPort : public Port {
 public:
  /// Opens `path` for this process alone: TIOCEXCL, and flock because root passes TIOCEXCL.
  /// DTR and RTS are raised where they exist. What arrived before it was opened is thrown away:
  /// it would be dated as if it came now.
  /// Throws PortError, also where the system makes another baud rate of the one that was asked for.
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
  [[noreturn]] void unplugged(const std::string& found) const;

  std::string path_, lasting_;  // lasting_: the name that it has wherever it is plugged in
  double speedup_;
  int descriptor_ = -1;
};

// Raw terminal settings through TCSETS2, which takes any baud rate (the board's 7,372,800 has no B constant).

constexpr unsigned kLeastBaud = 50, kMostBaud = 100'000'000;

/// Eight bits, no parity, no flow control, no translation, `baud` in both directions.
/// Returns 0 or the errno of the call that failed.
int set_raw_terminal(int descriptor, unsigned baud);

struct PortInfo {
  std::string path;     ///< /dev/ttyACM0
  std::string usb_id;   ///< "0483:5740", empty when not USB
  std::string product;  ///< as the device calls itself
};

/// Ports with a device behind them, by name.
std::vector<PortInfo> list_ports();

/// A path that still names the device behind `path` after it was plugged in again: its link in `links` (which
/// has the device's USB name and serial number), else the device. A pseudo-terminal has no name of its own,
/// its number goes to the next one opened; there it is `path`, absolute.
std::string lasting_port_name(const std::string& path, const std::string& links = "/dev/serial/by-id");

}  // namespace supertac
