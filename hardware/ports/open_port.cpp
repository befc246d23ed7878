// Ports by address: serial lines, sockets, files and FIFOs.
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "data/sensors/sensor.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/port.h"
#include "hardware/ports/serial_port.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr int kSocketBytes = 4 << 20;
constexpr int kPatienceS = 5;  // with a name server, and with a host that does not answer

/// Bytes of a descriptor that are only read.
class DescriptorPort : public Port {
 public:
  enum class Kind { file, fifo, stream, datagrams, lines };

  DescriptorPort(std::string name, int descriptor, Kind kind)
      : name_(std::move(name)), descriptor_(descriptor), kind_(kind) {}
  ~DescriptorPort() override { close(descriptor_); }
  DescriptorPort(const DescriptorPort&) = delete;
  DescriptorPort& operator=(const DescriptorPort&) = delete;

  const std::string& name() const override { return name_; }
  double now() override { return monotonic_seconds(); }

  Received read(std::span<std::byte> buffer, double until) override {
    do {
      if (!wait_for(descriptor_, POLLIN, until - now())) continue;
      // A line's end is added to a datagram, and must fit.
      const bool lines = kind_ == Kind::lines;
      const ssize_t count = ::read(descriptor_, buffer.data(), buffer.size() - (lines ? 1 : 0));
      if (count < 0 && (errno == EINTR || errno == EAGAIN || errno == ECONNREFUSED)) continue;
      if (count < 0) gone(strerror(errno));
      auto bytes = static_cast<std::size_t>(count);
      if (lines && (bytes == 0 || buffer[bytes - 1] != std::byte{'\n'})) buffer[bytes++] = std::byte{'\n'};
      if (bytes > 0) {
        began_ = true;
        return {bytes, now()};
      }
      if (kind_ == Kind::datagrams) continue;  // an empty one
      // A FIFO that nobody has opened to write looks as one that has been closed.
      if (kind_ != Kind::fifo || began_) gone("");
      usleep(static_cast<useconds_t>(1e6 * std::clamp(until - now(), 0.0, kReadSlice)));
    } while (now() < until);
    return {0, now()};
  }

  double write(std::span<const std::byte>, double) override {
    throw PortError("port " + name_ + ": expected a port that can be written to; it is only read");
  }

 private:
  [[noreturn]] void gone(const std::string& why) const {
    if (why.empty() && kind_ != Kind::stream) throw PortEnded("port " + name_ + ": the end");
    throw PortUnplugged("port " + name_ + ": the other side is gone (" + (why.empty() ? "closed" : why) +
                        "); see whether it still runs, and start again");
  }

  std::string name_;
  int descriptor_;
  Kind kind_;
  bool began_ = false;
};

[[noreturn]] void fail(const std::string& address, const std::string& problem) {
  throw PortError("port " + printable(address) + ": " + problem);
}

// The only port with the VID:PID of the rig's board.
std::string board_port() {
  std::vector<PortInfo> boards = list_ports();
  std::erase_if(boards, [](const PortInfo& port) { return port.usb_id != rig::kBoardUsbId; });
  if (boards.size() == 1) return boards.front().path;
  throw PortError("port auto: expected one tactile board (USB " + std::string(rig::kBoardUsbId) +
                  "), found " + std::to_string(boards.size()) + "; plug it in, or name the port");
}

OpenedPort open_serial(const std::string& address, const std::string& rest, double speedup) {
  const std::size_t at = rest.rfind('@');
  const auto baud = at == std::string::npos ? std::nullopt : parse_uint(rest.substr(at + 1));
  if (!baud || *baud < kLeastBaud || *baud > kMostBaud || at == 0)
    fail(address, "expected serial:DEVICE@BAUD, such as serial:/dev/ttyACM0@115200");
  const SerialSettings settings{.baud = static_cast<unsigned>(*baud), .speedup = speedup};
  const std::string device = rest.substr(0, at);
  return {std::make_unique<SerialPort>(device == "auto" ? board_port() : device, settings)};
}

struct FreeAddresses {
  void operator()(addrinfo* list) const { freeaddrinfo(list); }
};
using HostAddresses = std::unique_ptr<addrinfo, FreeAddresses>;

// What a thread of the C library reads and writes while it asks.
struct Question {
  std::string host, service;
  addrinfo wanted{};
  gaicb entry{};
};

/// Of `host` (empty: of this computer, to listen at) and `port`, for sockets of `type`. getaddrinfo() alone
/// may wait for name servers for minutes; here at most kPatienceS, and less when a signal comes.
HostAddresses host_addresses(const std::string& what, const std::string& host, int port, int type) {
  auto question = std::make_unique<Question>();
  question->host = host, question->service = std::to_string(port);
  question->wanted.ai_socktype = type;
  question->wanted.ai_family = host.empty() ? AF_INET : AF_UNSPEC;
  question->wanted.ai_flags = host.empty() ? AI_PASSIVE : 0;
  gaicb& entry = question->entry;
  entry.ar_name = host.empty() ? nullptr : question->host.c_str();
  entry.ar_service = question->service.c_str(), entry.ar_request = &question->wanted;
  gaicb* entries[] = {&entry};
  int error = getaddrinfo_a(GAI_NOWAIT, entries, 1, nullptr);
  if (error == 0) {
    const timespec patience{kPatienceS, 0};
    (void)gai_suspend(entries, 1, &patience);
    error = gai_error(&entry);
  }
  if (error == EAI_INPROGRESS) {
    // Who cannot be stopped goes on writing there.
    if (gai_cancel(&entry) == EAI_NOTCANCELED) (void)question.release();
    throw PortError(what +
                    ": the name server does not answer; see whether the host is right, or give its number");
  }
  HostAddresses found(entry.ar_result);
  if (error != 0) throw PortError(what + ": " + gai_strerror(error) + "; see whether the host is right");
  return found;
}

/// Bound, or connected in time; nothing, and errno, when that fails or a signal comes.
std::optional<int> open_socket(const addrinfo& at, bool datagrams, double until) {
  const int type = at.ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK;
  const int descriptor = socket(at.ai_family, type, at.ai_protocol);
  if (descriptor < 0) return std::nullopt;
  // What arrives while the reader is held up; the kernel gives at most net.core.rmem_max.
  (void)setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &kSocketBytes, sizeof kSocketBytes);
  int error = 0;
  if (datagrams) {
    error = bind(descriptor, at.ai_addr, at.ai_addrlen) == 0 ? 0 : errno;
  } else if (connect(descriptor, at.ai_addr, at.ai_addrlen) != 0) {
    error = errno;
    pollfd entry{descriptor, POLLOUT, 0};
    socklen_t size = sizeof error;
    const auto wait_ms = static_cast<int>(1e3 * std::max(0.0, until - monotonic_seconds()));
    const int ready = error == EINPROGRESS ? poll(&entry, 1, wait_ms) : 0;
    if (error == EINPROGRESS && ready != 1) error = ready == 0 ? ETIMEDOUT : errno;
    if (error == EINPROGRESS) (void)getsockopt(descriptor, SOL_SOCKET, SO_ERROR, &error, &size);
  }
  if (error == 0) return descriptor;
  close(descriptor);
  errno = error;
  return std::nullopt;
}

OpenedPort open_network(const std::string& address, const std::string& rest, bool datagrams, bool lines) {
  const std::size_t colon = rest.rfind(':');
  const std::string host = colon == std::string::npos ? "" : rest.substr(0, colon);
  const auto number = colon == std::string::npos ? std::nullopt : parse_uint(rest.substr(colon + 1));
  if (!number || *number < 1 || *number > 65535 || (host.empty() && !datagrams))
    fail(address, "expected udp:[HOST]:PORT or tcp:HOST:PORT, such as udp::5005");
  const HostAddresses found = host_addresses("port " + printable(address), host, static_cast<int>(*number),
                                             datagrams ? SOCK_DGRAM : SOCK_STREAM);
  std::optional<int> descriptor;
  const double until = monotonic_seconds() + kPatienceS;
  std::ptrdiff_t left = 0;
  for (const addrinfo* at = found.get(); at != nullptr; at = at->ai_next) ++left;
  errno = ETIMEDOUT;
  for (const addrinfo* at = found.get(); at != nullptr && !descriptor && errno != EINTR; at = at->ai_next) {
    const double now = monotonic_seconds();  // a silent address leaves time for the next
    descriptor = open_socket(*at, datagrams, now + std::max(0.0, until - now) / static_cast<double>(left--));
  }
  if (!descriptor)
    fail(address, std::string(strerror(errno)) + (datagrams ? "; another program may listen there"
                                                            : "; see whether the sensor serves there"));
  using Kind = DescriptorPort::Kind;
  const Kind kind = !datagrams ? Kind::stream : lines ? Kind::lines : Kind::datagrams;
  return {std::make_unique<DescriptorPort>(address, *descriptor, kind)};
}

OpenedPort open_file(const std::string& path) {
  const bool input = path == "-";
  const int descriptor = input ? fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3)
                               : open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  struct stat status {};
  if (descriptor < 0 || fstat(descriptor, &status) != 0)
    fail(path, std::string(strerror(errno)) +
                   "; expected serial:DEVICE@BAUD, udp:[HOST]:PORT, tcp:HOST:PORT, - or a file");
  auto port = std::make_unique<DescriptorPort>(
      input ? "standard input" : path, descriptor,
      S_ISFIFO(status.st_mode) && !input ? DescriptorPort::Kind::fifo : DescriptorPort::Kind::file);
  if (S_ISDIR(status.st_mode)) fail(path, "expected a file or FIFO, found a folder");
  if (S_ISCHR(status.st_mode) && !input && isatty(descriptor) != 0)
    fail(path, "is a serial port, whose speed must be said: serial:" + path + "@115200");
  return {std::move(port), false, S_ISREG(status.st_mode)};
}

}  // namespace

OpenedPort open_port(const std::string& address, bool lines, double speedup) {
  const auto after = [&](const char* scheme) -> std::optional<std::string> {
    if (!address.starts_with(scheme)) return std::nullopt;
    return address.substr(strlen(scheme));
  };
  if (const auto rest = after("serial:")) return open_serial(address, *rest, speedup);
  if (const auto rest = after("udp:")) return open_network(address, *rest, true, lines);
  if (const auto rest = after("tcp:")) return open_network(address, *rest, false, lines);
  return open_file(address);
}

OpenedPort open_port(const Sensor& sensor, double speedup) {
  const bool lines = sensor.frame.kind == FrameKind::text || sensor.frame.kind == FrameKind::json;
  return open_port(sensor.port, lines, speedup);
}

}  // namespace supertac
