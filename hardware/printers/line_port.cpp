#include "hardware/printers/line_port.h"

#include <algorithm>
#include <array>
#include <span>

namespace supertac {

double LinePort::send(const std::string& text) {
  constexpr double kWriteDeadline = 2;  // s
  const double before = port_.now();
  port_.write(std::as_bytes(std::span(text)), before + kWriteDeadline);
  return before;
}

bool LinePort::take(std::string& line) {
  for (;;) {
    const std::size_t end = input_.find_first_of("\r\n");
    if (end == std::string::npos) return false;
    line.assign(input_, 0, end);
    input_.erase(0, end + 1);
    while (!line.empty() && line.back() == ' ') line.pop_back();
    if (!line.empty()) return true;
  }
}

bool LinePort::read(double until, std::string& line) {
  constexpr double kWatchInterval = 0.02;  // a fifth of the 0.1 s in which an unplugged board must be noticed
  std::array<std::byte, 4096> buffer{};    // no line is longer
  while (!take(line)) {
    if (watch_) watch_();
    const Received got = port_.read(buffer, watch_ ? std::min(until, port_.now() + kWatchInterval) : until);
    const auto bytes = std::span(buffer).first(got.count);
    if (!bytes.empty()) arrival_s_ = got.time_s;
    bytes_ += bytes.size();
    no_text_ +=
        static_cast<std::size_t>(std::ranges::count_if(bytes, [](std::byte b) { return !is_text(b); }));
    if (bytes.empty() && got.time_s >= until) return false;
    input_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (input_.size() <= buffer.size() || input_.find_first_of("\r\n") != std::string::npos) continue;
    input_.clear();
    if (got.time_s >= until) return false;  // bytes come for ever, and no line does
  }
  return true;
}

}  // namespace supertac
