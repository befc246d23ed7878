// The head's way through a pass, by its positions or by how long its moves took.
#include <algorithm>
#include <cmath>

#include "hardware/collection/collection.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

// How far along the leg's straight line the sample is, and how far from it, ends included.
struct OnLeg {
  double along, off;
};
OnLeg on_leg(const Leg& leg, const Point3& p) {
  const double length = distance(leg.from, leg.to);
  const double part =
      ((p.x - leg.from.x) * (leg.to.x - leg.from.x) + (p.y - leg.from.y) * (leg.to.y - leg.from.y) +
       (p.z - leg.from.z) * (leg.to.z - leg.from.z)) /
      std::max(length * length, 1e-12);
  const double held = std::clamp(part, 0.0, 1.0);
  return {held * length, distance(p, between(leg.from, leg.to, held))};
}

/// Those that were answered in the usual time.
std::vector<PositionSample> on_time(const std::vector<PositionSample>& samples) {
  std::vector<double> trips;
  for (const PositionSample& sample : samples) trips.push_back(sample.round_trip_s);
  const double slowest = samples.empty() ? 0 : 3 * median(trips) + 0.001;
  std::vector<PositionSample> kept;
  for (const PositionSample& sample : samples)
    if (sample.round_trip_s <= slowest) kept.push_back(sample);
  return kept;
}

/// Times and ways along the leg, away from its ramps.
std::vector<std::pair<double, double>> cruise_of(const Leg& leg, const std::vector<PositionSample>& samples) {
  const double length = distance(leg.from, leg.to);
  std::vector<std::pair<double, double>> places;
  for (const PositionSample& sample : samples) {
    const OnLeg at = on_leg(leg, sample.position);
    if (at.off < kToleranceMm && at.along > 0.15 * length && at.along < 0.85 * length)
      places.emplace_back(sample.time_s, at.along);
  }
  return places;
}

// The median over pairs of samples some way apart: neither damaged samples nor a machine that stood still for
// a while move it, and no order takes part in it. 0 of too few.
double speed_of(std::span<const std::pair<double, double>> places) {
  const std::size_t apart = std::max<std::size_t>(1, places.size() / 8);
  std::vector<double> speeds;
  for (std::size_t i = 0; places.size() >= 8 && i + apart < places.size(); ++i) {
    const double seconds = places[i + apart].first - places[i].first;
    if (seconds > 0) speeds.push_back((places[i + apart].second - places[i].second) / seconds);
  }
  return speeds.empty() ? 0 : std::max(0.0, median(speeds));
}

// By how much of the speed it differs from one half of the way to the other, and from its mean: the head may
// have stood on the way.
double unevenness_of(std::span<const std::pair<double, double>> places) {
  const double speed = speed_of(places), half = speed_of(places.first(places.size() / 2)),
               rest = speed_of(places.subspan(places.size() / 2));
  if (!(speed > 0 && half > 0 && rest > 0)) return 0;
  const double mean = (places.back().second - places.front().second) /
                      std::max(1e-9, places.back().first - places.front().first);
  return std::max(std::abs(half - rest), std::abs(mean - speed)) / speed;
}

// The samples that can all be true, as many as possible. Nothing damaged is believed for its neighbours'
// sake: what nothing else can be reached from stands alone.
std::vector<PositionSample> chain_of(const Leg& leg, double fastest,
                                     const std::vector<PositionSample>& samples) {
  std::vector<PositionSample> good = {{leg.sent_s, 0, leg.from}};
  for (const PositionSample& sample : samples)
    if (on_leg(leg, sample.position).off < kToleranceMm) good.push_back(sample);
  if (leg.ended_s > 0) good.push_back({leg.ended_s, 0, leg.to});
  const auto follows = [&](std::size_t before, std::size_t after) {
    return reachable(fastest, good[before], good[after]) &&
           distance(leg.from, good[before].position) < distance(leg.from, good[after].position) + 0.015;
  };
  std::vector<std::size_t> length(good.size(), 0), from(good.size(), 0);  // 0: of no chain from the start
  length[0] = 1;
  std::size_t best = 0;
  for (std::size_t i = 1; i < good.size(); ++i) {
    const auto extend = [&](std::size_t j) {
      if (length[j] > 0 && length[j] + 1 > length[i] && follows(j, i)) length[i] = length[j] + 1, from[i] = j;
    };
    for (std::size_t j = i > 64 ? i - 64 : 0; j < i; ++j) extend(j);
    extend(0);
    if (length[i] >= length[best]) best = i;
  }
  std::vector<PositionSample> chain;
  for (std::size_t i = best; i > 0; i = from[i]) chain.push_back(good[i]);
  std::reverse(chain.begin(), chain.end());
  if (!chain.empty() && leg.ended_s > 0 && chain.back().time_s == leg.ended_s) chain.pop_back();
  return chain;
}

double took(const Leg& leg) { return leg.ended_s - leg.accepted_s; }

/// Beyond its length over its speed, of each leg that `taken` takes.
template <class Taken>
std::vector<double> beyond(std::span<const Leg> legs, const Taken& taken) {
  std::vector<double> seconds;
  for (const Leg& leg : legs)
    if (leg.speed > 0 && leg.from != leg.to && taken(leg)) seconds.push_back(took(leg) - ordered_s(leg));
  std::sort(seconds.begin(), seconds.end());
  return seconds;
}

}  // namespace

MoveTiming timing_of(std::span<const Leg> ended) {
  constexpr std::size_t kEnough = 4;
  MoveTiming timing;
  double speed = 0, slow = 0;
  for (const Leg& leg : ended) speed = leg.phase == Phase::slide ? leg.speed : speed;
  const auto in_the_air = [](const Leg& leg) {
    return leg.phase == Phase::approach && leg.from.z == leg.to.z;
  };
  for (const Leg& leg : ended)
    if (in_the_air(leg) && leg.speed < speed && (slow == 0 || leg.speed < slow)) slow = leg.speed;
  std::vector<double> fast_s = beyond(ended, [&](const Leg& l) { return in_the_air(l) && l.speed == speed; });
  const std::vector<double> slow_s =
      beyond(ended, [&](const Leg& l) { return in_the_air(l) && l.speed == slow; });
  if (fast_s.size() < kEnough) fast_s = beyond(ended, [](const Leg&) { return true; });
  if (fast_s.empty()) return timing;
  const double fast_beyond = median(std::vector(fast_s));
  double ramps = speed / timing.acceleration;
  if (slow_s.size() >= kEnough) {
    const double slow_beyond = median(std::vector(slow_s)), part = slow / speed;
    const double most = std::max(0.0, fast_beyond - slow_beyond) / (1 - part);  // ramps that grow with v
    timing.range_s = 0.5 * part * most;
    ramps = most - timing.range_s;
    // Both speeds together show how answers spread: a damaged one of a few hides nothing then.
    for (const double s : slow_s) fast_s.push_back(s + fast_beyond - slow_beyond);
    std::ranges::sort(fast_s);
  } else {
    timing.range_s = ramps;
  }
  timing.delay_s = fast_beyond - ramps;
  timing.acceleration = std::clamp(speed / std::max(ramps, 1e-9), 20.0, 1e5);  // mm/s^2
  if (fast_s.size() >= kEnough) timing.spread_s = fast_s[fast_s.size() - 2] - fast_s[1];
  std::vector<double> slides;
  for (const Leg& leg : ended)
    if (leg.phase == Phase::slide && leg.speed > 0)
      slides.push_back((took(leg) - timing.delay_s - leg.speed / timing.acceleration) / ordered_s(leg));
  if (slides.size() < 3) return timing;
  const double slowness = median(slides);
  if (std::abs(slowness - 1) < 0.02) timing.slowness = slowness;
  return timing;
}

double fitted_speed(const Leg& leg, const std::vector<PositionSample>& samples) {
  return speed_of(cruise_of(leg, on_time(samples)));
}

void PositionTrack::add(double time_s, const Point3& position) {
  if (points_.empty() || time_s > points_.back().time_s) points_.push_back({time_s, position});
}

// Between two samples the head can have been away from the straight line in time, by as much as its speed
// allows. Where it cannot even have come from the one to the other, all that lies between is guessed.
void PositionTrack::distrust(double fastest, const PositionSample& before, const PositionSample& after) {
  if (!(fastest > 0) || !(after.time_s > before.time_s)) return;
  const double way = distance(before.position, after.position);
  const double farthest = fastest * (after.time_s - before.time_s);
  const double away = way < farthest                      ? way * (1 - way / farthest)
                      : reachable(fastest, before, after) ? way - farthest
                                                          : way;
  const double when_s = 0.5 * std::max(before.round_trip_s, after.round_trip_s);
  points_.back().doubt_mm =
      std::max(points_.back().doubt_mm, away + when_s * fastest + 0.01);  // mm: both are rounded
  doubt_mm_ = std::max(doubt_mm_, points_.back().doubt_mm);
}

void PositionTrack::model(const Leg& leg, const MoveTiming& timing) {
  const double length = distance(leg.from, leg.to);
  if (!(leg.speed > 0)) return add(leg.ended_s, leg.to);
  // Longer or shorter than the run's other moves: nobody knows where on the way the head was slow.
  const double ramps = leg.speed / timing.acceleration;
  const double off_s = took(leg) - timing.delay_s -
                       timing.slowness * trapezoid_duration(length, leg.speed, timing.acceleration);
  const double wrong_s = std::abs(off_s) + timing.spread_s + 0.5 * timing.range_s;
  const double wrong_mm = std::min(length, wrong_s * leg.speed);
  doubt_mm_ = std::max(doubt_mm_, wrong_mm);
  const double cruise_s = took(leg) - timing.delay_s - ramps;
  const bool as_ordered = std::abs(cruise_s - ordered_s(leg)) < timing.spread_s + timing.range_s;
  if (leg.phase == Phase::slide && cruise_s > 0) speed_ = as_ordered ? leg.speed : length / cruise_s;
  const double start = std::min(std::max(leg.accepted_s + timing.delay_s, leg.sent_s), leg.ended_s - 1e-6);
  const double duration = leg.ended_s - start;
  const int steps = static_cast<int>(std::clamp(duration / 0.005, 1.0, 2e4));  // every 5 ms, for 100 s
  for (int i = 0; i <= steps; ++i) {
    const double t = duration * i / steps;
    const double part =
        length > 0 ? trapezoid_position(t, length, duration, timing.acceleration) / length : 1;
    add(start + t, between(leg.from, leg.to, part));
    points_.back().doubt_mm = std::max(points_.back().doubt_mm, wrong_mm);
  }
}

void PositionTrack::add_leg(const Leg& leg, const std::vector<PositionSample>& samples,
                            const MoveTiming& timing) {
  add(leg.sent_s, leg.from);
  if (samples.empty() && leg.ended_s > 0) return model(leg, timing);
  const std::vector<PositionSample> prompt = on_time(samples);
  const double fitted = speed_of(cruise_of(leg, prompt)), fastest = timing.faster * leg.speed;
  const std::vector<PositionSample> chain = chain_of(leg, fastest, prompt);
  rejected_ += samples.size() - chain.size();
  if (prompt.size() >= 20)
    misfits_ = std::max(misfits_, 1 - static_cast<double>(chain.size()) / static_cast<double>(prompt.size()));
  if (leg.phase == Phase::slide) speed_ = fitted, unevenness_ = unevenness_of(cruise_of(leg, chain));
  PositionSample before{leg.sent_s, 0, leg.from};
  for (const PositionSample& sample : chain) {
    add(sample.time_s, sample.position);
    distrust(fastest, before, sample);
    before = sample;
  }
  if (leg.ended_s > 0) {
    add(leg.ended_s, leg.to);
    distrust(fastest, before, {leg.ended_s, 0, leg.to});
  }
}

std::string PositionTrack::doubt(double trusted_mm) const {
  std::string doubt;
  if (doubt_mm_ > trusted_mm) doubt += "the head may have been " + format(doubt_mm_, 1) + " mm elsewhere; ";
  if (misfits_ > 0.1) doubt += format(100 * misfits_, 0) + " % of its positions fit no way; ";
  if (unevenness_ > 0.01) doubt += "its speed was not even (" + format(100 * unevenness_, 0) + " %); ";
  return doubt;
}

PositionTrack::Knot PositionTrack::at(double time_s) const {
  if (points_.empty()) return {};
  const auto after = std::lower_bound(points_.begin(), points_.end(), time_s,
                                      [](const Knot& knot, double t) { return knot.time_s < t; });
  if (after == points_.begin()) return points_.front();
  if (after == points_.end()) return points_.back();
  const Knot& a = *(after - 1);
  const Knot& b = *after;
  const double part = (time_s - a.time_s) / (b.time_s - a.time_s);
  return {time_s, between(a.position, b.position, part), b.doubt_mm};
}

}  // namespace supertac
