#include "tests/hardware/virtual_rig/faults.h"

namespace supertac {

RigFaults RigFaults::mixed(double rate) {
  return {.byte_rate = rate,
          .lost_ok_rate = rate,
          .resend_storm_rate = rate / 10,
          .reset_rate = rate / 200,
          .unplug_rate = rate / 200,
          .stall_rate = rate / 10,
          .lost_frame_rate = rate};
}

std::vector<std::byte> ByteFaults::apply(std::span<const std::byte> bytes) {
  if (!(rate_ > 0)) return {bytes.begin(), bytes.end()};
  std::vector<std::byte> out;
  out.reserve(bytes.size() + 8);
  for (const std::byte byte : bytes) {
    if (!dice_.hit(rate_)) {
      out.push_back(byte);
      continue;
    }
    switch (dice_.below(3)) {
      case 0:
        break;
      case 1:
        out.push_back(byte ^ static_cast<std::byte>(1U << dice_.below(8)));
        break;
      default:
        out.push_back(byte);
        out.push_back(static_cast<std::byte>(dice_.below(256)));
    }
  }
  return out;
}

}  // namespace supertac
