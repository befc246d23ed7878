#include "hardware/printers/printer.h"

#include <algorithm>
#include <cmath>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kHomeDeadline = 180, kStopDeadline = 3, kPollDeadline = 0.25;
constexpr double kPrompt = 0.1;    // of an answer, where it must come before the head starts
constexpr double kMoveMargin = 8;  // start delay, acceleration, and a firmware that is slower than ordered

std::string coordinates(const Point3& p) {
  return " X" + format(p.x, 3) + " Y" + format(p.y, 3) + " Z" + format(p.z, 3);
}

// A firmware may report its queue's end (M154) between any two lines: the answer is the last position before
// the ok.
const Reply* position_in(const MarlinLink::Answer& answer) {
  for (auto reply = answer.replies.rbegin(); reply != answer.replies.rend(); ++reply) {
    if (reply->kind == ReplyKind::position) return &*reply;
  }
  return nullptr;
}

// How far from the plate's corner the head is still over the plate, and above the slide free of it.
constexpr double kBeforeX = 2.2, kBehindX = 39.3, kBeforeY = 2.17, kBehindY = 110.33, kClearance = 3.19;

void check_axis(char axis, double value, double low, double high) {
  if (std::isfinite(value) && value >= low && value <= high) return;
  const std::string found = std::isfinite(value) ? format(value, 2) : "no number";
  throw OutsideLimits(std::string("limits: ") + axis + " expected " + format(low, 2) + " to " +
                      format(high, 2) + " mm, found " + found +
                      "; nothing was sent, correct the plan or the limits");
}

}  // namespace

double trapezoid_position(double t, double distance, double duration, double acceleration) {
  if (t <= 0) return 0;
  if (t >= duration) return distance;
  // A duration too short for the acceleration means the model's acceleration is too small: use the triangle.
  const double a = std::max(acceleration, 4 * distance / (duration * duration));
  const double speed =
      0.5 * a * (duration - std::sqrt(std::max(0.0, duration * duration - 4 * distance / a)));
  const double ramp = speed / a;
  if (t < ramp) return 0.5 * a * t * t;
  if (t > duration - ramp) return distance - 0.5 * a * (duration - t) * (duration - t);
  return speed * (t - 0.5 * ramp);
}

double trapezoid_duration(double distance, double speed, double acceleration) {
  if (distance < speed * speed / acceleration) return 2 * std::sqrt(distance / acceleration);
  return distance / speed + speed / acceleration;
}

double Limits::clearance_z() const { return plate.z + kClearance; }

void Limits::check_path(const Point3& from, const Point3& to) const {
  for (const Point3& end : {from, to}) {
    check_axis('X', end.x, low.x, high.x);
    check_axis('Y', end.y, low.y, high.y);
    check_axis('Z', end.z, low.z, high.z);
  }
  const double clearance = clearance_z();
  if (std::min(from.z, to.z) >= clearance) return;
  // The part of the line below the clearance is a line itself, and the plate a rectangle: its ends decide.
  double first = 0, last = 1;
  if (from.z != to.z) {
    const double crossing = (clearance - from.z) / (to.z - from.z);
    if (from.z > clearance) first = crossing;
    if (to.z > clearance) last = crossing;
  }
  for (const Point3& end : {between(from, to, first), between(from, to, last)}) {
    const bool over_plate = end.x >= plate.x - kBeforeX && end.x <= plate.x + kBehindX &&
                            end.y >= plate.y - kBeforeY && end.y <= plate.y + kBehindY;
    if (!over_plate) {
      throw OutsideLimits("limits: the way from " + describe(from) + " to " + describe(to) + " passes " +
                          describe(end) + ", below Z" + format(clearance, 2) +
                          " and beside the plate; nothing was sent, lift first");
    }
  }
}

std::string move_command(const Point3& target, double speed_mm_s) {
  return "G1" + coordinates(target) + " F" + format(60 * speed_mm_s, 1);
}

void Printer::connect() {
  origin_ = Origin::unknown;
  link_.connect();
  state_.set(link_, false);
}

std::string Printer::put_back() {
  try {
    link_.set_watch(nullptr), link_.answer_pauses();  // nothing ends it but its bound
    link_.give_up_at(link_.port().now() + kStopDeadline);
    if (link_.in_use()) state_.put_back(link_);
  } catch (const HardwareError&) {  // nobody is there to put it back
  }
  return state_.kept();
}

void Printer::home() {
  state_.set(link_, true);
  try {
    // Klipper moves nothing before it knows where it is: it is told a place, for the lift alone.
    if (link_.capabilities().klipper) link_.command("SET_KINEMATIC_POSITION Z=0");
    const Point3 here = agreed_position();
    raise(here, here.z + 2 * rig::kLiftMm);  // wherever z is, first away from the plate
    link_.command("G28", kHomeDeadline);
    state_.set(link_, true);  // which homing may undo
  } catch (const PrinterRefused&) {
    throw;  // and so it stands
  } catch (const PrinterHalted&) {
    throw;
  } catch (...) {
    link_.set_watch(nullptr);
    link_.give_up_at(link_.port().now() + kStopWithin);
    // Nothing else stops a Klipper that homes; it has to be restarted.
    (void)(link_.capabilities().klipper ? emergency_stop() : quick_stop());
    throw;
  }
  target_ = agreed_position();
  origin_ = Origin::homed;
  if (target_.z >= limits_.clearance_z()) return;
  raise(target_, limits_.clearance_z());
  finish_move();
}

void Printer::confirm_origin(const Point3& here) {
  limits_.check_path(here, here);
  link_.command("M400", kHomeDeadline);
  if (link_.capabilities().klipper)
    link_.command("SET_KINEMATIC_POSITION X=" + format(here.x, 3) + " Y=" + format(here.y, 3) +
                  " Z=" + format(here.z, 3));
  link_.command("G92" + coordinates(here));
  target_ = here;
  const Point3 found = agreed_position();
  if (distance(found, here) > kToleranceMm) {
    throw PositionError("printer " + link_.port().name() + ": after G92 expected " + describe(here) +
                        ", found " + describe(found) + "; confirm the origin again");
  }
  origin_ = Origin::confirmed;
}

MarlinLink::Answer Printer::start_move(const Point3& target, double speed_mm_s) {
  if (origin_ == Origin::unknown) {
    throw OriginUnknown("printer " + link_.port().name() +
                        ": the origin is neither homed nor confirmed; nothing was sent, home or confirm it");
  }
  limits_.check_path(target_, target);
  const double length = distance(target_, target);
  MarlinLink::Answer answer = order(move_command(target, speed_mm_s), target_, target);
  remark_.clear();
  for (const Reply& reply : answer.replies)
    if (reply.kind == ReplyKind::other && reply.text.starts_with("echo:")) remark_ = reply.text;
  target_ = target;
  expected_seconds_ += length / speed_mm_s + 0.5;
  return answer;
}

// Klipper checks no line: a damaged one runs as what it has become. Where its queue ends is asked before the
// head starts, a quarter of a second later.
MarlinLink::Answer Printer::order(const std::string& move, const Point3& from, const Point3& to) {
  if (!link_.capabilities().klipper) return link_.command(move);
  Point3 end = from;
  for (int attempt = 0; attempt < kAttempts && distance(end, from) <= kToleranceMm; ++attempt) {
    MarlinLink::Answer answer = link_.command(move, kPrompt);
    end = queue_position(kPrompt);
    if (distance(end, to) > kToleranceMm) end = agreed_position(kPrompt);
    if (distance(end, to) <= kToleranceMm) return answer;
  }
  const Stop stop = emergency_stop();
  throw PositionError("printer " + link_.port().name() + ": ordered " + describe(to) + ", but Klipper took " +
                      describe(end) +
                      ", for it checks no line that a cable damages; it was stopped by M112 (" + stop.text +
                      "), check the cable");
}

double Printer::longest_s() const { return 1.5 * expected_seconds_ + kMoveMargin; }

double Printer::finish_move() {
  MarlinLink::Answer answer = link_.command("M400", longest_s());
  // Klipper is silent at M400: what it says is a complaint of a damaged one, damaged itself.
  for (int i = 1; i < kAttempts && link_.capabilities().klipper && !answer.replies.empty(); ++i)
    answer = link_.command("M400", longest_s());
  const double end = answer.answered_s;
  expected_seconds_ = 0;
  Point3 found;
  for (int attempt = 0; attempt < 3; ++attempt) {
    found = queue_position();
    if (distance(found, target_) <= kToleranceMm) return end;
    link_.settle();
    link_.command("M400", kMoveMargin);
  }
  origin_ = Origin::unknown;
  const std::optional<SoftLimits> soft = soft_limits_of(link_);
  throw PositionError("printer " + link_.port().name() + ": expected the head at " + describe(target_) +
                      ", found " + describe(found) + "; confirm the origin and start again" +
                      (remark_.empty() ? "" : "; it said " + in_quotes(remark_)) +
                      (soft ? "; its soft endstops (M211) are on: " + in_quotes(soft->text) : ""));
}

std::optional<PositionSample> Printer::sample_position(double deadline_s) {
  const MarlinLink::Answer answer = link_.command("M114 R", deadline_s > 0 ? deadline_s : kPollDeadline);
  const Reply* reply = position_in(answer);
  if (answer.repeated || reply == nullptr) return std::nullopt;
  return PositionSample{0.5 * (answer.sent_s + answer.answered_s), answer.answered_s - answer.sent_s,
                        reply->position};
}

Point3 Printer::queue_position(double deadline_s) {
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const MarlinLink::Answer answer = link_.command("M114", deadline_s);
    if (const Reply* reply = position_in(answer)) return reply->position;
    link_.settle();
  }
  throw PrinterSilent("printer " + link_.port().name() + ": expected a position from M114, found none in " +
                      std::to_string(kAttempts) + " answers; check the cable");
}

Point3 Printer::agreed_position(double deadline_s) {
  Point3 before = queue_position(deadline_s);
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const Point3 now = queue_position(deadline_s);
    if (distance(before, now) < 0.005) return now;
    before = now;
  }
  throw PositionError("printer " + link_.port().name() +
                      ": expected two equal positions in a row, found none in " +
                      std::to_string(kAttempts + 1) + " answers; check the cable");
}

bool Printer::stands_still() {
  Point3 before;
  int same = 0;
  for (const double until = link_.port().now() + kStopDeadline; same < 3 && link_.port().now() < until;) {
    if (same > 0) link_.idle(0.1);
    // M410 holds Marlin for a second, in which it answers nothing.
    const auto sample = sample_position(kStopDeadline);
    if (!sample) continue;
    same = same > 0 && distance(before, sample->position) < 0.005 ? same + 1 : 1;
    before = sample->position;
  }
  return same >= 3;
}

Printer::Stop Printer::quick_stop() {
  const auto& [name, parser, klipper] = link_.capabilities();
  Stop stop;
  try {
    if (!klipper) link_.emergency("M410");
    link_.settle();
    const bool stands = klipper || stands_still();
    // The position of the queue is that of the head only once nothing moves any more.
    link_.command("M400", parser ? kStopDeadline : longest_s());
    target_ = agreed_position();
    expected_seconds_ = 0;
    stop.confirmed = stands;
  } catch (const PrinterHalted&) {
    stop.confirmed = true;
  } catch (const HardwareError& error) {
    stop.text = std::string("the head could not be shown to stand still, switch the printer off (") +
                error.what() + ")";
    return stop;
  }
  stop.text = stop.confirmed ? "the head stands still"
                             : "the head could not be shown to stand still; switch the printer off";
  if (!parser && !klipper)
    stop.text +=
        " (this firmware has no emergency parser: a stop acts when its line is read, not before an M400 "
        "ends)";
  return stop;
}

Printer::Stop Printer::emergency_stop() {
  Stop stop;
  origin_ = Origin::unknown;
  try {
    for (const double until = link_.port().now() + kStopDeadline; link_.port().now() < until;) {
      link_.emergency("M112\nM112");  // and again: a damaged one is none
      link_.idle(kPrompt);
    }
    stop.text = "no answer to the emergency stop; switch the printer off";
  } catch (const PrinterHalted&) {
    stop.confirmed = true;
    stop.text = "the firmware halted; reset the printer before the next start";
  } catch (const HardwareError& error) {
    stop.text = error.what();
  }
  if (!stop.confirmed && !link_.capabilities().emergency_parser)
    stop.text += " (this firmware has no emergency parser)";
  return stop;
}

// Not through start_move(): it is the way out of a position that the limits forbid.
void Printer::raise(const Point3& from, double z) {
  target_ = {from.x, from.y, z};
  order("G1 Z" + format(z, 3) + " F" + format(60 * rig::kLiftMmS, 1), from, target_);
  expected_seconds_ += std::abs(z - from.z) / rig::kLiftMmS + 0.5;
}

void Printer::lift_out(double z) {
  const bool stops = !link_.capabilities().klipper;
  stops ? link_.stop() : link_.abandon(longest_s());
  raise(stops ? Point3{target_.x, target_.y, limits_.low.z} : agreed_position(), std::min(z, limits_.high.z));
  link_.command("M400", longest_s());
  const Point3 found = agreed_position();
  if (std::abs(found.z - target_.z) > kToleranceMm)
    throw PositionError("printer " + link_.port().name() + ": expected the finger lifted to Z" +
                        format(target_.z, 2) + ", found it at " + describe(found) + "; lift it by hand");
  target_ = found;
  expected_seconds_ = 0;
}

}  // namespace supertac
