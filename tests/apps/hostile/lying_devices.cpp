#include <algorithm>
#include <array>
#include <iostream>
#include <memory>
#include <vector>

#include "tests/apps/hostile/hostile.h"
#include "tests/hardware/fault_run.h"

namespace supertac {
namespace {

/// A printer's port that says something else than the printer did, from line to line or, once it begins, for
/// ever.
class LyingPort : public WrappedPort {
 public:
  LyingPort(std::unique_ptr<Port> inner, std::uint64_t seed)
      : WrappedPort(std::move(inner)),
        dice_(seed, 77),
        kind_(dice_.below(kKinds)),
        rate_(0.002 + 0.02 * dice_.uniform()),
        from_line_(dice_.below(400)) {}

  static std::uint32_t kind_of(std::uint64_t seed) { return Dice(seed, 77).below(kKinds); }
  Received read(std::span<std::byte> buffer, double until) override {
    while (said_.empty()) {
      const double next = for_ever() ? std::min(until, said_s_ + 1) : until;
      std::array<std::byte, 1024> raw{};
      const Received got = inner_->read(raw, next);
      for (std::size_t i = 0; i < got.count; ++i) take(std::to_integer<char>(raw[i]));
      now_ = got.time_s;
      if (for_ever() && now_ >= said_s_ + 1)
        say(kind_ == 0   ? "echo:busy: processing"
            : kind_ == 1 ? "Resend: 2\nok"
                         : "// still at it"),
            said_s_ = now_;
      if (said_.empty() && now_ >= until) return {0, now_};
    }
    return hand_on(buffer);
  }

 private:
  static constexpr std::uint32_t kKinds = 22;
  // Kinds 0 to 3: from some line on nothing but this.
  bool for_ever() const { return kind_ < 4 && lines_ > from_line_; }
  void say(const std::string& line) { said_ += line + "\n"; }

  void take(char c) {
    line_ += c;
    if (c != '\n') return;
    ++lines_;
    if (for_ever()) {
      line_.clear();
      return;
    }
    const bool lies = kind_ >= 4 && dice_.hit(rate_);
    if (lies) lie();
    if (!(lies && kind_ == 4)) said_ += line_;
    line_.clear();
  }

  // Ahead of the printer's own line; kind 4 is a line that is lost.
  void lie() {
    const std::string number = std::to_string(dice_.below(200));
    const std::string said[] = {
        "",
        "ok",
        "ok\nok",
        "Resend: " + number,
        "Error:Line Number is not Last Line Number+1, Last Line: " + number + "\nResend: " + number,
        "!! Move out of range",
        "// Unknown command:\"M114\"",
        "echo:Unknown command: \"M400\"",
        "start",
        "X:1e308 Y:nan Z:-500 E:0 Count X:0 Y:0 Z:0",
        "echo:busy: paused for user",
        "FR:150%",
        "echo:  G20 ; (in)",
        "echo:Bed Leveling ON",
        "// gcode homing: X:0.000000 Y:0.000000 Z:-1.000000",
        "echo:Soft endstops: ON  Min: X0.00 Y0.00 Z0.00  Max: X1.00 Y1.00 Z1.00",
        "//action:" + std::string(dice_.hit(0.5) ? "pause" : "cancel"),
        std::string(5000, 'x')};
    if (kind_ - 4 < std::size(said)) said_ += said[kind_ - 4] + (kind_ == 4 ? "" : "\n");
  }

  Dice dice_;
  std::uint32_t kind_;
  double rate_;
  std::uint32_t from_line_, lines_ = 0;
  std::string line_;
  double said_s_ = 0;
};

}  // namespace

Counts lying_devices(std::uint64_t n, std::uint64_t seed) {
  Counts counts;
  for (std::uint64_t i = 0; i < n; ++i, ++counts["collections"]) {
    DrawnRun drawn(seed + i);
    RigSettings& rig = drawn.rig;
    rig.faults.byte_rate = 0;  // lies are enough
    const auto lie = [&](std::unique_ptr<Port> port) -> std::unique_ptr<Port> {
      return std::make_unique<LyingPort>(std::move(port), seed + i);
    };
    FaultVerdict verdict = run_faulty_collection(rig, drawn.plan, drawn.origin, lie);
    ++counts[verdict.complete ? "complete" : "typed errors"];
    // Nobody can know where a finger is whose printer says nothing true: then the user must be told.
    if (verdict.broken.find("switch the printer off") != std::string::npos) verdict.broken.clear();
    // A liar says itself what it had been set to.
    if (verdict.broken.find("put back") != std::string::npos) verdict.broken.clear();
    if (verdict.broken.empty()) continue;
    ++counts["broken promises"];
    std::cerr << "collection " << i << ", firmware " << static_cast<int>(rig.printer.firmware) << ", M114 R "
              << rig.printer.realtime_position << ", chunks of " << rig.chunk_s << " s, board stands still "
              << rig.faults.freeze_rate << ", host " << rig.faults.host_freeze_rate << ", lie "
              << LyingPort::kind_of(seed + i) << ": " << verdict.broken << " (" << verdict.error << ")\n";
  }
  return counts;
}

}  // namespace supertac
