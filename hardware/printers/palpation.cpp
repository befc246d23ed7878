#include "hardware/printers/palpation.h"

#include <algorithm>
#include <cmath>
#include <ranges>
#include <utility>

#include "hardware/ports/serial_port.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kLiftWithin = 60;  // in contact
constexpr double kPollS = 0.01;     // from position to position
constexpr const char* kHalted = "the firmware halted and takes no more commands; lift the finger by hand";
constexpr double kLiftAgain = 0.5;  // s, behind a lift that failed
constexpr int kMeasuredPairs = 3;   // of short moves to and fro, at the slide's speed and a slow one
constexpr double kSlowMmS = 2;      // whose ramps take next to no time
constexpr int kClaims = 3;  // of having arrived at once, before a firmware is taken for one without M114 R

using Json = nlohmann::ordered_json;

constexpr double kFarthest = 1e4;  // mm
constexpr const char* kPoint = "three numbers of mm within 10000, [x, y, z] of the printer";
constexpr int kMostPasses = 1000, kMostPrinterBaud = 1'000'000;

template <class Number>
Number within(JsonObject& keys, const char* name, double low, double high, Number value) {
  const auto text = [](double v) { return std::is_integral_v<Number> ? format(v, 0) : format(v); };
  if (!(value >= low && value <= high)) keys.wrong(name, text(low) + " to " + text(high), Json(value));
  return value;
}

Point3 take_point(JsonObject& keys, const char* name, const std::optional<Point3>& fallback = {}) {
  if (fallback && keys.find(name) == nullptr) return *fallback;
  const std::vector<double> numbers = keys.numbers(name);  // none where it is absent
  const auto is_near = [](double v) { return v >= -kFarthest && v <= kFarthest; };
  if (numbers.size() != 3 || !std::ranges::all_of(numbers, is_near)) keys.wrong(name, kPoint, Json(numbers));
  return {numbers[0], numbers[1], numbers[2]};
}

Json json_of(const Point3& p) { return {p.x, p.y, p.z}; }

class Palpation {
 public:
  Palpation(Printer& printer, const PalpationPlan& plan, const PalpationObserver& observer)
      : printer_(printer), plan_(plan), observer_(observer) {}
  PalpationOutcome run();

 private:
  void run_leg(Leg& leg);
  void measure_start(const Leg& onset);
  void touch(bool contact);
  void follow(const Leg& leg);
  void recover(PalpationOutcome& outcome);

  Printer& printer_;
  const PalpationPlan& plan_;
  const PalpationObserver& observer_;
  bool realtime_known_ = false, realtime_ = true;
  bool in_contact_ = false;
  double longest_leg_s_ = 0;  // that a firmware may have to come to the end of
};

}  // namespace

const char* name_of(Phase phase) {
  constexpr const char* kNames[] = {"approach", "onset", "slide", "release", "reposition"};
  return kNames[static_cast<std::size_t>(phase)];
}

bool reachable(double speed, const PositionSample& from, const PositionSample& to) {
  const double seconds = 1.05 * (to.time_s - from.time_s) + 0.5 * (from.round_trip_s + to.round_trip_s);
  return to.time_s > from.time_s && distance(from.position, to.position) < speed * seconds + kToleranceMm;
}

double ordered_s(const Leg& leg) { return distance(leg.from, leg.to) / leg.speed; }

double seconds_left(const Leg& now, const Point3& at) {
  return distance(at, now.to) / now.speed + now.behind_s;
}

std::vector<Leg> legs_of(const PalpationPlan& plan, const Point3& here) {
  const auto usable = [](double value) { return value > 0 && std::isfinite(value); };
  if (plan.passes < 1 || plan.passes > kMostPasses || !usable(plan.slide) || !usable(plan.lift) ||
      !usable(plan.speed))
    throw std::invalid_argument(
        refusal("palpation", "plan",
                "1 to " + std::to_string(kMostPasses) + " passes, and slide, lift and speed above 0",
                std::to_string(plan.passes) + " passes, a slide of " + format(plan.slide) +
                    " mm, a lift of " + format(plan.lift) + " mm and " + format(plan.speed) + " mm/s"));
  std::vector<Leg> legs;
  Point3 at = here;
  const auto add = [&](int pass, Phase phase, const Point3& to, double speed) {
    legs.push_back({pass, phase, at, to, speed});
    at = to;
  };
  const double high = plan.start.z + plan.lift;
  add(1, Phase::approach, {at.x, at.y, std::max(at.z, high)}, rig::kLiftMmS);
  for (int pass = 1; pass <= plan.passes; ++pass) {
    const double x = plan.start.x + plan.shift_x * (pass - 1);
    const double y = plan.start.y, z = plan.start.z;
    const Phase travel = pass == 1 ? Phase::approach : Phase::reposition;
    add(pass, travel, {x, y, std::max(at.z, high)}, rig::kFastestMmS);
    add(pass, travel, {x, y, high}, rig::kLiftMmS);
    add(pass, Phase::onset, {x, y, z}, rig::kLiftMmS);
    add(pass, Phase::slide, {x, y + plan.slide, z}, plan.speed);
    add(pass, Phase::release, {x, y + plan.slide, high}, rig::kLiftMmS);
  }
  // Back to where it began: the next run's operator confirms the same place.
  add(plan.passes, Phase::reposition, {at.x, at.y, std::max(here.z, high)}, rig::kLiftMmS);
  add(plan.passes, Phase::reposition, {here.x, here.y, at.z}, rig::kFastestMmS);
  std::erase_if(legs, [](const Leg& leg) { return leg.from == leg.to; });
  double behind_s = 0;
  for (Leg& leg : legs | std::views::reverse)
    leg.behind_s = std::exchange(behind_s, behind_s + ordered_s(leg));
  return legs;
}

std::vector<Leg> legs_within(const Limits& limits, const PalpationPlan& plan, const Point3& here) {
  std::vector<Leg> legs = legs_of(plan, here);
  for (const Leg& leg : legs) limits.check_path(leg.from, leg.to);
  return legs;
}

double planned_s(const Bed& bed) {
  const Leg first = legs_of(bed.plan, bed.origin).front();
  return seconds_left(first, first.from);
}

PalpationOutcome run_palpation(Printer& printer, const PalpationPlan& plan,
                               const PalpationObserver& observer) {
  return Palpation(printer, plan, observer).run();
}

PalpationOutcome Palpation::run() {
  std::vector<Leg> legs = legs_within(printer_.limits(), plan_, printer_.target());
  std::optional<SoftLimits> soft;
  if (printer_.origin() == Printer::Origin::homed) soft = soft_limits_of(printer_.link());
  for (const Leg& leg : legs) {
    longest_leg_s_ = std::max(longest_leg_s_, ordered_s(leg));
    if (soft && soft->cut(leg.to))
      throw OutsideLimits("printer " + printer_.link().port().name() +
                          ": its soft endstops (M211) would cut the way to " + describe(leg.to) +
                          "; it says " + in_quotes(soft->text) +
                          ", correct the plan or the firmware's limits");
  }
  PalpationOutcome outcome;
  printer_.link().set_watch(observer_.check);
  try {
    for (Leg& leg : legs) {
      if (leg.phase == Phase::onset && leg.pass == 1) measure_start(leg);
      if (leg.phase == Phase::onset) touch(true);
      run_leg(leg);
      if (leg.phase != Phase::release) continue;
      touch(false);
      ++outcome.passes_done;
    }
    outcome.complete = true;
  } catch (...) {
    outcome.error = std::current_exception();
  }
  printer_.link().set_watch(nullptr);
  if (!outcome.complete) recover(outcome);
  if (in_contact_) touch(false);
  return outcome;
}

void Palpation::touch(bool contact) {
  in_contact_ = contact;
  observer_.contact(contact);
}

// Without M114 R nothing but M400 tells where the head is in time. What short moves at the slide's speed take
// beyond their length over it - the delay of their start and their ramps - holds for the slide as well; at a
// slow speed next to nothing of it is ramps.
void Palpation::measure_start(const Leg& onset) {
  // Of different lengths: a firmware that answers M400 every 0.1 s would be late by the same time at all of
  // them.
  const Point3 here = onset.from;
  for (const double speed : {plan_.speed, std::min(kSlowMmS, plan_.speed / 4)}) {
    for (int pair = 0; pair < kMeasuredPairs && !(realtime_ && realtime_known_); ++pair) {
      const double way = std::max(0.2 * speed, speed * speed / 250) + 0.5 + 0.035 * pair * speed;
      const Point3 there{here.x, here.y + way, here.z};
      for (const auto& [from, to] : {std::pair{here, there}, {there, here}}) {
        Leg leg{.pass = onset.pass, .from = from, .to = to, .speed = speed};
        leg.behind_s = ordered_s(onset) + onset.behind_s;
        run_leg(leg);
      }
    }
  }
}

void Palpation::run_leg(Leg& leg) {
  observer_.check();
  const MarlinLink::Answer answer = printer_.start_move(leg.to, leg.speed);
  leg.sent_s = answer.sent_s;
  leg.accepted_s = answer.answered_s;
  observer_.leg_started(leg);
  if (realtime_) follow(leg);
  leg.ended_s = printer_.finish_move();
  observer_.leg_ended(leg);
}

// Polls the position until the head arrives. A firmware that reports the end of the queue instead gives
// itself away: it claims again and again to have arrived before the head can be there. A single such claim is
// M154's report in the place of a damaged answer.
void Palpation::follow(const Leg& leg) {
  const double length = distance(leg.from, leg.to);
  const double until = leg.accepted_s + printer_.longest_s();
  double next = leg.accepted_s;
  int claims = 0;
  PositionSample before{leg.sent_s, 0, leg.from};
  for (double time = next; time < until;) {
    const auto sample = printer_.sample_position();
    time = printer_.link().port().now();
    observer_.check();
    if (sample) {
      const bool arrived = distance(sample->position, leg.to) < 0.02;
      const bool possible = reachable(leg.speed, before, *sample);
      if (!possible && arrived && length > 1 && ++claims >= kClaims) {
        realtime_ = realtime_known_;  // else it is faster than ordered
        return;
      }
      realtime_known_ = realtime_known_ || (possible && !arrived && length > 1);
      if (possible || !arrived) observer_.position(leg, *sample);
      if (possible && arrived) return;
      if (possible) before = *sample;
    }
    next = std::max(next + kPollS, time);
    if (next > time) printer_.link().idle(next - time);
  }
  throw PositionError(std::string("palpation: the head did not arrive at ") + describe(leg.to) +
                      " in time (pass " + std::to_string(leg.pass) + ", " + name_of(leg.phase) +
                      "); check the printer");
}

void Palpation::recover(PalpationOutcome& outcome) {
  using Finger = PalpationOutcome::Finger;
  outcome.finger = in_contact_ ? Finger::unknown : Finger::lifted;
  bool pauses = false;
  try {
    std::rethrow_exception(outcome.error);
  } catch (const PrinterHalted&) {
    outcome.finger = Finger::stopped;
    outcome.note = kHalted;
    return;
  } catch (const PrinterReset&) {
    // Should it only have said so, it still moves: a stop does no harm to one that has just started.
    try {
      printer_.link().emergency(printer_.link().capabilities().klipper ? "M112" : "M410");
    } catch (const HardwareError&) {  // that it restarted
    }
    outcome.finger = Finger::stopped;
    outcome.note = "the firmware restarted and stands; its position is unknown, lift the finger by hand";
    return;
  } catch (const PrinterPaused&) {
    pauses = true;
  } catch (...) {  // everything else leaves a printer that can be talked to, or one that is gone: see below
  }
  MarlinLink& link = printer_.link();
  for (double until = 0;;) {
    try {
      const double now = link.port().now();
      if (until == 0) {
        until = now + (in_contact_ ? kLiftWithin + 1.5 * longest_leg_s_ : kStopWithin);
        link.give_up_at(until);
        link.answer_pauses();
      } else if (now >= until) {  // what cannot be lifted stands at least
        link.give_up_at(now + kLiftWithin);
        if (!printer_.emergency_stop().confirmed) return;
      } else {
        link.idle(kLiftAgain);
      }
      if (std::exchange(pauses, false)) link.emergency("M108");
      if (!in_contact_) {
        outcome.note = printer_.quick_stop().text;
        return;
      }
      printer_.lift_out(plan_.start.z + plan_.lift);
      outcome.finger = Finger::lifted;
      outcome.note = "the finger was lifted";
      return;
    } catch (const PortUnplugged&) {
      outcome.note = "the printer cannot be reached; the finger may be in contact, lift it by hand";
      return;
    } catch (const PrinterHalted&) {
      outcome.finger = Finger::stopped;
      outcome.note = kHalted;
      return;
    } catch (const ReplayDiverged&) {
      return;
    } catch (const std::exception& error) {
      outcome.note = std::string("the lift failed, lift the finger by hand and switch the printer off (") +
                     error.what() + ")";
    }
  }
}

Bed bed_of_json(const std::string& text, const std::string& where) {
  Bed bed;
  PalpationPlan& plan = bed.plan;
  try {
    JsonObject keys(parse_json_limited(text), where);
    bed.limits.plate = take_point(keys, "plate");
    bed.origin = take_point(keys, "origin");
    bed.limits.high = take_point(keys, "high");
    bed.limits.low = take_point(keys, "low", bed.limits.low);
    plan.start = bed.limits.plate;
    plan.start.x +=
        within(keys, "first_x_mm", 0, rig::kPlateWidthMm, keys.number("first_x_mm", rig::pass_x_mm(1)));
    plan.shift_x = within(keys, "shift_mm", -rig::kPlateWidthMm, rig::kPlateWidthMm,
                          keys.number("shift_mm", plan.shift_x));
    plan.passes = within(keys, "passes", 1, kMostPasses, keys.integer("passes", plan.passes));
    plan.slide = within(keys, "slide_mm", 1, rig::kPlateLengthMm, keys.number("slide_mm", plan.slide));
    plan.lift = within(keys, "lift_mm", 1, 100, keys.number("lift_mm", plan.lift));
    plan.speed = within(keys, "speed_mm_s", 0.5, rig::kFastestMmS, keys.number("speed_mm_s", plan.speed));
    const int baud = keys.integer("baud", static_cast<int>(bed.baud));
    bed.baud = static_cast<unsigned>(within(keys, "baud", kLeastBaud, kMostPrinterBaud, baud));
    keys.no_others();
  } catch (const JsonError& error) {
    throw FileError(where, error.what());
  }
  return bed;
}

Bed read_bed(const std::string& path) {
  return bed_of_json(read_text_file(path, JsonLimits().max_bytes), path);
}

Json json_of(const Bed& bed) {
  const PalpationPlan& plan = bed.plan;
  return {{"plate", json_of(bed.limits.plate)},
          {"origin", json_of(bed.origin)},
          {"high", json_of(bed.limits.high)},
          {"low", json_of(bed.limits.low)},
          {"first_x_mm", plan.start.x - bed.limits.plate.x},
          {"shift_mm", plan.shift_x},
          {"passes", plan.passes},
          {"slide_mm", plan.slide},
          {"lift_mm", plan.lift},
          {"speed_mm_s", plan.speed},
          {"baud", bed.baud}};
}

}  // namespace supertac
