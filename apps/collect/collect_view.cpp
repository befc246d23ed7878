#include "apps/collect/collect_view.h"

#include <signal.h>

#include "apps/common/running/signals.h"
#include "apps/web/pages.h"
#include "data/plates/truth.h"
#include "data/sensors/rig.h"
#include "hardware/printers/marlin_line.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr int kWidth = static_cast<int>(rig::kPlateWidthMm), kLength = static_cast<int>(rig::kPlateLengthMm);

// A run that lifts the finger is under way after the first wish; a second one would end it at once.
std::string stop_as_ctrl_c() {
  if (!interrupted()) raise(SIGINT);  // on this thread: heard before a second press is
  return "the finger is lifted and the run ends; what was collected is kept";
}

}  // namespace

CollectView::CollectView(const WebAddress& address, const Plate& plate, const Bed& bed, double speedup,
                         const std::string& source)
    : plate_(plate),
      bed_(bed),
      legs_(legs_of(bed.plan, bed.origin)),
      speedup_(speedup),
      source_(source),
      server_(address, site()) {}

WebSite CollectView::site() {
  return {.page = collect_page(),
          .hello = [this] { return hello(); },
          .news = [this] { return news(); },
          .actions = {{"stop", stop_as_ctrl_c}}};
}

void CollectView::update(const Leg& leg, const Point3& at, const ReaderCounters& board) {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (lock) newest_ = State{leg, at, board};
}

std::string CollectView::hello() const {
  std::vector<float> heights;  // of square millimetres, row by row of y
  for (int y = 0; y < kLength; ++y)
    for (int x = 0; x < kWidth; ++x)
      heights.push_back(static_cast<float>(truth_value(plate_, x + 0.5, y + 0.5)));
  const PalpationPlan& plan = bed_.plan;
  std::vector<double> passes;
  for (int pass = 0; pass < plan.passes; ++pass)
    passes.push_back(plan.start.x + plan.shift_x * pass - bed_.limits.plate.x);
  return dumped({{"plate", plate_.name()},
                 {"source", source_},
                 {"plan", std::to_string(plan.passes) + " passes of " + format(plan.slide, 0) + " mm at " +
                              format(plan.speed, 1) + " mm/s, " + format(plan.lift, 0) + " mm lift"},
                 {"width", kWidth},
                 {"length", kLength},
                 {"heights", levels_base64(heights)},
                 {"map", colour_map_base64()},
                 {"passes", passes}});
}

std::string CollectView::news() {
  std::optional<State> state;
  {
    const std::lock_guard lock(mutex_);
    state.swap(newest_);
  }
  if (!state) return {};
  const auto& [leg, at, board] = *state;
  const double left_s = seconds_left(legs_, leg, at);
  return dumped({{"pass", leg.pass},
                 {"phase", name_of(leg.phase)},
                 {"x", at.x - bed_.limits.plate.x},
                 {"y", at.y - bed_.limits.plate.y},
                 {"lifted", at.z > bed_.plan.start.z + 0.1},
                 {"left_s", left_s / speedup_},
                 {"done", 1 - left_s / seconds_left(legs_, legs_.front(), legs_.front().from)},
                 {"frames", board.decoder.frames},
                 {"rate", board.period_s > 0 ? 1 / board.period_s : 0},
                 {"lost", board.missing},
                 {"suspect", board.suspect}});
}

}  // namespace supertac
