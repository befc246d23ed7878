#include "hardware/boards/listen.h"

#include <algorithm>
#include <utility>

#include "hardware/ports/errors.h"

namespace supertac {

std::vector<Heard> listen(const OpenedPort& opened, const std::string& port, double seconds,
                          const std::function<bool()>& stop) {
  std::vector<Heard> heard;
  std::vector<std::byte> buffer(65536);
  std::size_t bytes = 0;
  // A machine that stands still listens to nothing: of each wait no more counts than was asked for.
  double now = opened.port->now(), listened = 0;
  try {
    while (!stop() && listened < seconds && bytes < (16 << 20)) {
      const Received got = opened.port->read(buffer, now + kReadSlice);
      const double before = std::exchange(now, opened.port->now());
      listened += std::min(now - before, kReadSlice);
      if (got.count == 0) continue;
      heard.push_back({got.time_s, {reinterpret_cast<const char*>(buffer.data()), got.count}});
      // As open_port() makes a line of it for a sensor that is known to send text.
      std::string& text = heard.back().bytes;
      if (port.starts_with("udp:") && std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; }))
        text += '\n';
      bytes += got.count;
    }
  } catch (const PortUnplugged&) {
  }
  return heard;
}

}  // namespace supertac
