// A collection in a browser, as supertac-collect --web shows it.
#pragma once

#include <signal.h>

#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/running/signals.h"
#include "apps/web/pages.h"
#include "apps/web/web_server.h"
#include "data/plates/plate.h"
#include "data/plates/truth.h"
#include "data/sensors/rig.h"
#include "hardware/collection/collection.h"
#include "io/numbers/numbers.h"

namespace supertac {

/// Serves collect_page(): the plan, the plate with the finger on it, and one action, "stop", which does what
/// Ctrl-C does. Nothing begins or moves anything.
class CollectView {
 public:
  /// `source` names ports and folder. Throws as WebServer.
  CollectView(const WebAddress& address, const Plate& plate, const Bed& bed, double speedup,
              const std::string& source)
      : bed_(bed),
        all_s_(planned_s(bed)),
        speedup_(speedup),
        server_(address, {.page = collect_page(),
                          .hello = [hello = hello_of(plate, bed, source)] { return hello; },
                          .news = [this] { return news(); },
                          .actions = {{"stop", stop_as_ctrl_c}}}) {}

  /// Never waits.
  void update(const Leg& leg, const Point3& at, const ReaderCounters& board) {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (lock) newest_ = State{leg, at, board};
  }
  std::string url() const { return server_.url(); }
  /// As WebServer.
  void end(const std::string& outcome, bool failed) { server_.end(outcome, failed); }

 private:
  struct State {
    Leg leg;
    Point3 at;
    ReaderCounters board;
  };

  // A run that lifts the finger is under way after the first wish; a second one would end it at once.
  static std::string stop_as_ctrl_c() {
    if (!interrupted()) raise(SIGINT);  // on this thread: heard before a second press is
    return "the finger is lifted and the run ends; what was collected is kept";
  }

  static std::string hello_of(const Plate& plate, const Bed& bed, const std::string& source) {
    constexpr int kWidth = static_cast<int>(rig::kPlateWidthMm),
                  kLength = static_cast<int>(rig::kPlateLengthMm);
    std::vector<float> heights;  // of square millimetres, row by row of y
    for (int y = 0; y < kLength; ++y)
      for (int x = 0; x < kWidth; ++x)
        heights.push_back(static_cast<float>(truth_value(plate, x + 0.5, y + 0.5)));
    const PalpationPlan& plan = bed.plan;
    std::vector<double> passes;
    for (int pass = 0; pass < plan.passes; ++pass)
      passes.push_back(plan.start.x + plan.shift_x * pass - bed.limits.plate.x);
    return dumped({{"plate", plate.name()},
                   {"source", source},
                   {"plan", std::to_string(plan.passes) + " passes of " + format(plan.slide, 0) + " mm at " +
                                format(plan.speed, 1) + " mm/s, " + format(plan.lift, 0) + " mm lift"},
                   {"width", kWidth},
                   {"length", kLength},
                   {"heights", levels_base64(heights)},
                   {"colours", colour_map_base64()},
                   {"passes", passes}});
  }

  std::string news() {
    std::optional<State> state;
    {
      const std::lock_guard lock(mutex_);
      state.swap(newest_);
    }
    if (!state) return {};
    const auto& [leg, at, board] = *state;
    const double left_s = seconds_left(leg, at);
    return dumped({{"pass", leg.pass},
                   {"phase", name_of(leg.phase)},
                   {"x", at.x - bed_.limits.plate.x},
                   {"y", at.y - bed_.limits.plate.y},
                   {"lifted", at.z > bed_.plan.start.z + 0.1},
                   {"left_s", left_s / speedup_},
                   {"done", 1 - left_s / all_s_},
                   {"frames", board.decoder.frames},
                   {"rate", board.period_s > 0 ? 1 / board.period_s : 0},
                   {"lost", board.missing},
                   {"suspect", board.suspect}});
  }

  Bed bed_;
  double all_s_, speedup_;
  std::mutex mutex_;
  std::optional<State> newest_;
  WebServer server_;  // last: its thread uses the others
};

}  // namespace supertac
