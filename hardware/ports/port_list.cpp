#include "hardware/ports/port_list.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "data/sensors/rig.h"
#include "hardware/ports/errors.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

std::string line_of(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return line;
}

}  // namespace

std::vector<PortInfo> list_ports() {
  std::vector<PortInfo> ports;
  std::error_code error;
  for (fs::directory_iterator entry("/sys/class/tty", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with("ttyACM") && !name.starts_with("ttyUSB")) continue;
    PortInfo port{"/dev/" + name, "", ""};
    // The USB device is one to three folders above the interface that carries the port.
    fs::path folder = fs::canonical(entry->path() / "device", error);
    for (int up = 0; up < 4 && !error; ++up, folder = folder.parent_path()) {
      if (!fs::exists(folder / "idVendor", error)) continue;
      port.usb_id = line_of(folder / "idVendor") + ":" + line_of(folder / "idProduct");
      port.product = line_of(folder / "product");
      break;
    }
    error.clear();
    ports.push_back(std::move(port));
  }
  std::sort(ports.begin(), ports.end(), [](const PortInfo& a, const PortInfo& b) { return a.path < b.path; });
  return ports;
}

std::string resolve_board_port(const std::string& path) {
  if (path != "auto") return path;
  std::vector<PortInfo> boards = list_ports();
  std::erase_if(boards, [](const PortInfo& port) { return port.usb_id != rig::kBoardUsbId; });
  if (boards.size() == 1) return boards.front().path;
  throw PortNotFound("port auto: expected one tactile board (USB " + std::string(rig::kBoardUsbId) +
                     "), found " + std::to_string(boards.size()) + "; plug it in, or name the port");
}

std::string lasting_port_name(const std::string& path, const std::string& links) {
  std::error_code error;
  const std::string device = fs::weakly_canonical(path, error).string();
  for (fs::directory_iterator entry(links, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code dangling;
    if (fs::canonical(entry->path(), dangling) == device && !dangling) return entry->path().string();
  }
  if (device.empty() || device.starts_with("/dev/pts/"))
    return fs::absolute(path).lexically_normal().string();
  return device;
}

}  // namespace supertac
