// Which USB serial ports there are, from sysfs.
#pragma once

#include <string>
#include <vector>

namespace supertac {

struct PortInfo {
  std::string path;     ///< /dev/ttyACM0
  std::string usb_id;   ///< "0483:5740", empty when not USB
  std::string product;  ///< as the device calls itself
};

/// Ports with a device behind them, by name.
std::vector<PortInfo> list_ports();

/// `path`, or for "auto" the only port with the board's VID:PID. Throws PortNotFound when there is none or
/// more than one.
std::string resolve_board_port(const std::string& path);

/// A path that still names the device behind `path` after it was plugged in again: its link in `links` (which
/// has the device's USB name and serial number), else the device. A pseudo-terminal has no name of its own,
/// its number goes to the next one opened; there it is `path`, absolute.
std::string lasting_port_name(const std::string& path, const std::string& links = "/dev/serial/by-id");

}  // namespace supertac
