#include "hardware/ports/serial_port.h"

#include <asm/termbits.h>  // has any baud rate; <termios.h> cannot be included beside it
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "hardware/ports/errors.h"
#include "io/numbers/clock.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

std::string line_of(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return line;
}

[[noreturn]] void open_failed(const std::string& path, int error) {
  const std::string at = "port " + path + ": ";
  switch (error) {
    case ENOENT:
      throw PortError(at +
                      "no such port; plug the device in, or run supertac-check machine to see what is there "
                      "and by which path it is found again under another number");
    case EACCES:
    case EPERM:
      throw PortError(at + "permission denied; run `sudo usermod -aG dialout $USER` and log in again");
    case EBUSY:
      throw PortError(at + "already open, by another program (see `fuser " + path +
                      "`) or twice by this one; close it, or name another port");
    case ENXIO:
    case ENODEV:
    case EIO:
      throw PortUnplugged(at + "the device behind it is gone (" + strerror(error) + "); plug it in again");
    default:
      throw PortError(at + "cannot be opened: " + strerror(error));
  }
}

// Boards with a bootloader want DTR and RTS; a pseudo-terminal has neither and says ENOTTY or EINVAL.
void raise_modem_lines(int descriptor) {
  int lines = TIOCM_DTR | TIOCM_RTS;
  (void)ioctl(descriptor, TIOCMBIS, &lines);
}

}  // namespace

int set_raw_terminal(int descriptor, unsigned baud) {
  termios2 settings{};
  if (ioctl(descriptor, TCGETS2, &settings) != 0) return errno;
  settings.c_iflag = settings.c_oflag = settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
  settings.c_ispeed = settings.c_ospeed = baud;
  settings.c_cc[VMIN] = 1;  // so that an empty port is EAGAIN and read 0 only ever means end of file
  settings.c_cc[VTIME] = 0;
  return ioctl(descriptor, TCSETS2, &settings) == 0 ? 0 : errno;
}

bool wait_for(int descriptor, short events, double seconds) {
  pollfd entry{descriptor, events, 0};
  return poll(&entry, 1, static_cast<int>(std::clamp(std::ceil(1e3 * seconds), 0.0, 1e9))) > 0;
}

double monotonic_seconds() { return seconds_of(CLOCK_MONOTONIC); }

SerialPort::SerialPort(const std::string& path, const SerialSettings& settings)
    : path_(path), lasting_(lasting_port_name(path)), speedup_(settings.speedup) {
  descriptor_ = open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor_ < 0) open_failed(path, errno);
  const auto give_up = [&](int error) {
    close(descriptor_);
    open_failed(path, error);
  };
  if (isatty(descriptor_) == 0) {
    close(descriptor_);
    throw PortError("port " + path +
                    ": expected a serial port, found another kind of file; run supertac-check machine");
  }
  if (flock(descriptor_, LOCK_EX | LOCK_NB) != 0) give_up(errno == EWOULDBLOCK ? EBUSY : errno);
  if (ioctl(descriptor_, TIOCEXCL) != 0) give_up(errno);
  if (const int error = set_raw_terminal(descriptor_, settings.baud)) give_up(error);
  constexpr double kTolerated = 0.02;  // of the rate; half a bit in a byte is lost at 5 %
  if (const unsigned found = baud(); found > 0 && std::abs(1.0 * found / settings.baud - 1) > kTolerated) {
    close(descriptor_);
    throw PortError("port " + path + ": expected " + std::to_string(settings.baud) +
                    " baud, its adapter makes " + std::to_string(found) +
                    " of it; choose a rate that it has, in the device and here");
  }
  raise_modem_lines(descriptor_);
  // What waited until somebody opened the port is old, and would be dated as if it came now.
  if (ioctl(descriptor_, TCFLSH, TCIFLUSH) != 0) give_up(errno);
}

SerialPort::~SerialPort() {
  (void)ioctl(descriptor_, TIOCNXCL);
  close(descriptor_);
}

unsigned SerialPort::baud() const {
  termios2 settings{};
  return ioctl(descriptor_, TCGETS2, &settings) == 0 ? settings.c_ospeed : 0;
}

Received SerialPort::read(std::span<std::byte> buffer, double until) {
  for (;;) {
    const ssize_t count = ::read(descriptor_, buffer.data(), buffer.size());
    if (count > 0) return {static_cast<std::size_t>(count), now()};
    if (count == 0) unplugged("end of file");
    if (errno == EINTR) continue;
    if (errno != EAGAIN) unplugged(strerror(errno));
    if (now() >= until) return {0, now()};
    (void)wait_for(descriptor_, POLLIN, (until - now()) / speedup_);
  }
}

double SerialPort::write(std::span<const std::byte> bytes, double until) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
    if (count > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(count));
      continue;
    }
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) unplugged(strerror(errno));
    if (now() >= until) {
      throw PortTimeout("port " + path_ + ": the device took no bytes before the deadline (" +
                        std::to_string(bytes.size()) + " left); switch it off and on again");
    }
    (void)wait_for(descriptor_, POLLOUT, (until - now()) / speedup_);
  }
  return now();
}

void SerialPort::unplugged(const std::string& found) const {
  throw PortUnplugged("port " + path_ + ": the device is gone (" + found +
                      "); check the cable and start again, nothing is resumed" +
                      (lasting_.starts_with("/dev/serial/") && lasting_ != path_
                           ? "; " + lasting_ + " names it under whatever number it comes back"
                           : ""));
}

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
