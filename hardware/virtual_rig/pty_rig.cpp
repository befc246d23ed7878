#include "hardware/virtual_rig/pty_rig.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "data/sensors/rig.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "hardware/ports/serial_termios.h"

namespace supertac {
namespace {

[[noreturn]] void failed(const std::string& what) {
  throw PortError("virtual rig: " + what + ": " + strerror(errno));
}

void link_at(const std::string& target, const std::string& link) {
  struct stat info {};
  if (lstat(link.c_str(), &info) == 0) {
    if (!S_ISLNK(info.st_mode)) {
      throw PortError("virtual rig: " + link + " exists and is not a link; choose another path");
    }
    if (unlink(link.c_str()) != 0) failed("cannot replace " + link);
  }
  if (symlink(target.c_str(), link.c_str()) != 0) failed("cannot link " + link);
}

}  // namespace

PseudoTerminal::PseudoTerminal(const std::string& link) : link_(link) {
  master_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) failed("cannot open a pseudo-terminal");
  std::array<char, 128> name{};
  if (ptsname_r(master_, name.data(), name.size()) != 0) failed("cannot name a pseudo-terminal");
  slave_ = name.data();
  // Held open so that the master does not see a hang-up between two programs; raw, so that nothing is echoed.
  keep_open_ = open(slave_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (keep_open_ < 0) failed("cannot open " + slave_);
  if (set_raw_terminal(keep_open_, rig::kPrinterBaud) != 0) failed("cannot configure " + slave_);
  link_at(slave_, link_);
}

PseudoTerminal::~PseudoTerminal() {
  unplug();
  unlink(link_.c_str());
}

void PseudoTerminal::unplug() {
  if (keep_open_ >= 0) close(keep_open_);
  if (master_ >= 0) close(master_);
  keep_open_ = master_ = -1;
}

double PtyRig::now(double speedup) { return monotonic_seconds() * speedup; }

PtyRig::PtyRig(std::unique_ptr<RigAtPorts> rig, const std::string& board_link,
               const std::string& printer_link, double speedup)
    : board_(board_link), printer_(printer_link), rig_(std::move(rig)), speedup_(speedup) {
  rig_->board_sink = [this](std::span<const std::byte> bytes, double) { return send_frame(bytes); };
  thread_ = std::thread([this] { run(); });
}

PtyRig::~PtyRig() {
  stop_ = true;
  thread_.join();
}

void PtyRig::run() {
  while (!stop_) {
    pollfd printer{-1, POLLIN, 0};
    timespec wait{0, 0};
    {
      std::lock_guard lock(mutex_);
      serve_printer();
      const double next = std::clamp((rig_->next_event() / speedup_) - monotonic_seconds(), 1e-4, 0.01);
      wait.tv_nsec = static_cast<long>(1e9 * next);
      printer.fd = printer_.descriptor();
    }
    ppoll(&printer, 1, &wait, nullptr);
  }
}

void PtyRig::serve_printer() {
  rig_->advance(now(speedup_));
  if (rig_->printer_unplugged()) printer_.unplug();
  if (printer_.descriptor() < 0) return;
  std::array<std::byte, 1024> buffer{};
  const ssize_t count = ::read(printer_.descriptor(), buffer.data(), buffer.size());
  if (count > 0) rig_->to_printer(std::span(buffer).first(static_cast<std::size_t>(count)));
  const std::vector<std::byte> fresh = rig_->from_printer();
  printer_out_.insert(printer_out_.end(), fresh.begin(), fresh.end());
  if (printer_out_.empty()) return;
  const ssize_t sent = ::write(printer_.descriptor(), printer_out_.data(), printer_out_.size());
  if (sent > 0) printer_out_.erase(printer_out_.begin(), printer_out_.begin() + sent);
  if (printer_out_.size() > 65536) printer_out_.clear();  // nobody listens
}

// When the terminal is full (4095 bytes, 24.8 ms) a frame vanishes; one that went in half is completed by
// nothing, as on a stalled USB line.
std::size_t PtyRig::send_frame(std::span<const std::byte> bytes) {
  if (board_.descriptor() < 0) return bytes.size();
  return static_cast<std::size_t>(
      std::max<ssize_t>(0, ::write(board_.descriptor(), bytes.data(), bytes.size())));
}

}  // namespace supertac
