// Passes of one plate onto each other.
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "data/recordings/resample.h"
#include "data/registration/registration.h"
#include "io/numbers/median.h"
#include "io/numbers/parallel.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

// --- Profiles: how far each of the four taxel rows is pressed along the plate: [row][point], the points
// every 0.1 mm from y = 22 to 92 mm. Each row has mean 0 and deviation 1; NaN where nothing is known.
constexpr std::size_t kProfileRows = rig::kTaxelRows, kProfilePoints = 701;
using Profile = std::array<std::array<double, kProfilePoints>, kProfileRows>;

constexpr double kFromMm = 22, kStepMm = 0.1, kSmoothMm = 1;
constexpr std::size_t kFewestPoints = 200;  // to speak of a correlation

// Mean 0, deviation 1 over the points that are known; all unknown when there are too few or nothing changes.
void standardise(std::array<double, kProfilePoints>& row) {
  double n = 0, sum = 0, squares = 0;
  for (const double v : row)
    if (std::isfinite(v)) n += 1, sum += v, squares += v * v;
  const double mean = sum / n, deviation = std::sqrt(std::max(0.0, squares / n - mean * mean));
  const bool flat = n < kFewestPoints || !(deviation > 1e-6);
  for (double& v : row) v = flat ? NAN : (v - mean) / deviation;
}

// The signals of a pass, made ready for many calls of along().
class PassSignals {
 public:
  // Those between the registration's valid_from_s and valid_until_s.
  PassSignals(const Recording& recording, const Registration& registration) {
    const auto& time = recording.time_s;
    const auto begin = std::lower_bound(time.begin(), time.end(), registration.valid_from_s);
    const auto end = std::upper_bound(begin, time.end(), registration.valid_until_s);
    time_s_.assign(begin, end);
    const auto first = static_cast<std::size_t>(begin - time.begin());
    for (std::size_t row = 0; row < kProfileRows; ++row) {
      sum_[row] = {0};
      for (std::size_t i = first; i < first + time_s_.size(); ++i) {
        double pressed = 0;
        for (std::size_t k = row * rig::kTaxelColumns; k < (row + 1) * rig::kTaxelColumns; ++k)
          pressed += Scaling{}(recording.signals[i * rig::kTaxels + k]) / rig::kTaxelColumns;
        sum_[row].push_back(sum_[row].back() + pressed);
      }
    }
  }

  const std::vector<double>& time_s() const { return time_s_; }

  // The same signals, later by `seconds` from at_s on.
  PassSignals delayed(double at_s, double seconds) const {
    PassSignals later = *this;
    for (double& t : later.time_s_) t += t >= at_s ? seconds : 0;
    return later;
  }

  // Each row's mean within 1 mm of each point, by start_mm and rate of a registration. A row is unknown where
  // fewer than 200 points are, or nothing changes.
  Profile along(const Registration& r) const {
    Profile profile;
    std::size_t from = 0, to = 0;
    for (std::size_t point = 0; point < kProfilePoints; ++point) {
      const double y = kFromMm + static_cast<double>(point) * kStepMm;
      while (from < time_s_.size() && r.start_mm + r.rate * time_s_[from] < y - kSmoothMm) ++from;
      while (to < time_s_.size() && r.start_mm + r.rate * time_s_[to] <= y + kSmoothMm) ++to;
      const bool known = from > 0 && to < time_s_.size() && from < to;
      for (std::size_t row = 0; row < kProfileRows; ++row)
        profile[row][point] =
            known ? (sum_[row][to] - sum_[row][from]) / static_cast<double>(to - from) : NAN;
    }
    for (auto& row : profile) standardise(row);
    return profile;
  }

 private:
  std::vector<double> time_s_;
  std::array<std::vector<double>, kProfileRows> sum_;  // of all frames before
};

// The mean of all profiles but one.
Profile mean_of_others(const std::vector<Profile>& profiles, std::size_t left_out) {
  Profile mean;
  for (std::size_t row = 0; row < kProfileRows; ++row)
    for (std::size_t point = 0; point < kProfilePoints; ++point) {
      double n = 0, sum = 0;
      for (std::size_t i = 0; i < profiles.size(); ++i)
        if (const double v = profiles[i][row][point]; i != left_out && std::isfinite(v)) n += 1, sum += v;
      mean[row][point] = n > 0 ? sum / n : NAN;
    }
  return mean;
}

// Pearson's correlation, mean over the rows in which both know 200 points; -1 when there is no such row.
double correlation(const Profile& a, const Profile& b) {
  double rows = 0, total = 0;
  for (std::size_t row = 0; row < kProfileRows; ++row) {
    double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
    for (std::size_t point = 0; point < kProfilePoints; ++point) {
      const double u = a[row][point], v = b[row][point];
      if (!std::isfinite(u) || !std::isfinite(v)) continue;
      n += 1, sa += u, sb += v, saa += u * u, sbb += v * v, sab += u * v;
    }
    if (n < kFewestPoints) continue;
    const double spread = (saa - sa * sa / n) * (sbb - sb * sb / n);
    if (spread > 0) rows += 1, total += (sab - sa * sb / n) / std::sqrt(spread);
  }
  return rows > 0 ? total / rows : -1;
}

// --- Passes onto each other.

constexpr double kMiddleMm = 54, kHalfMm = 26;
constexpr double kPenalty = 0.002, kUsualShiftMm = 0.5, kUsualStretchMm = 1;
constexpr double kFirstStepMm = 0.4, kLastStepMm = 0.01;
constexpr int kRounds = 6;
constexpr std::size_t kFewestPasses = 3;
constexpr double kLeastAgreement = 0.5;
// A loss is sought where passes disagree, and believed when they agree so much better with it.
constexpr double kDisagreement = 0.9, kGain = 0.05;
constexpr double kLossEveryS = 0.2, kLossStepS = 0.1, kLongestLossS = 0.8;

// Its line moved by its shift and stretch: y' = y + a + b (y - 54) / 26 of y = start + rate t is a line
// again.
Registration moved(Registration r) {
  const double stretch = r.stretch_mm / kHalfMm;
  r.start_mm += r.shift_mm + stretch * (r.start_mm - kMiddleMm);
  r.rate *= 1 + stretch;
  return r;
}

// The shift and stretch, from those that it has on, with which it agrees best with the others: pattern search
// (Hooke & Jeeves 1961), steps along both, halved when none is better.
Registration best_moved(const PassSignals& signals, const Registration& start, const Profile& others) {
  const auto score = [&](Registration& r) {
    r.agreement = correlation(signals.along(moved(r)), others);
    const double shift = r.shift_mm / kUsualShiftMm, stretch = r.stretch_mm / kUsualStretchMm;
    return r.agreement - kPenalty * (shift * shift + stretch * stretch);
  };
  Registration best = start;
  double highest = score(best);
  for (double step = kFirstStepMm; step >= kLastStepMm;) {
    bool better = false;
    for (const auto& [shift, stretch] : {std::pair(step, 0.0), {-step, 0}, {0, step}, {0, -step}}) {
      Registration tried = best;
      tried.shift_mm += shift, tried.stretch_mm += stretch;
      const double value = score(tried);
      if (value > highest) highest = value, best = tried, better = true;
    }
    if (!better) step /= 2;
  }
  return best;
}

// The one loss of frames with which the pass agrees best with the others, if by much.
Registration with_loss(const PassSignals& signals, const Registration& without, const Profile& others) {
  Registration best = without;
  const std::vector<double>& time = signals.time_s();
  for (double at = time.front() + kLossEveryS; at < time.back(); at += kLossEveryS) {
    for (double seconds = kLossStepS; seconds <= kLongestLossS; seconds += kLossStepS) {
      Registration tried = without;
      tried.lost_at_s = at, tried.lost_s = seconds;
      // The line was fitted to contacts of both parts of the pass: it is about right in the longer one.
      if (at < (tried.valid_from_s + tried.valid_until_s) / 2) tried.start_mm -= tried.rate * seconds;
      tried = best_moved(signals.delayed(at, seconds), tried, others);
      if (tried.agreement > best.agreement) best = tried;
    }
  }
  return best.agreement > without.agreement + kGain ? best : without;
}

struct Aligned {
  Registration* result;
  Registration registration;  // where it was, and how it is to be moved
  PassSignals signals;

  Profile profile() const { return signals.along(moved(registration)); }
};

std::vector<Profile> profiles_of(const std::vector<Aligned>& passes) {
  std::vector<Profile> profiles;
  for (const Aligned& pass : passes) profiles.push_back(pass.profile());
  return profiles;
}

void take_medians_off(std::vector<Aligned>& passes) {
  std::vector<double> shifts, stretches;
  for (const Aligned& pass : passes) {
    shifts.push_back(pass.registration.shift_mm);
    stretches.push_back(pass.registration.stretch_mm);
  }
  const double shift = median(shifts), stretch = median(stretches);
  for (Aligned& pass : passes) pass.registration.shift_mm -= shift, pass.registration.stretch_mm -= stretch;
}

void align(std::vector<Aligned>& passes) {
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<Profile> profiles = profiles_of(passes);
    parallel_for(passes.size(), [&](std::size_t i) {
      Aligned& pass = passes[i];
      pass.registration = best_moved(pass.signals, pass.registration, mean_of_others(profiles, i));
    });
    take_medians_off(passes);
  }
}

bool find_losses(std::vector<Aligned>& passes) {
  const std::vector<Profile> profiles = profiles_of(passes);
  bool any = false;
  for (std::size_t i = 0; i < passes.size(); ++i) {
    auto& [result, registration, signals] = passes[i];
    if (registration.agreement > kDisagreement || registration.agreement < kLeastAgreement) continue;
    registration = with_loss(signals, registration, mean_of_others(profiles, i));
    if (registration.lost_s == 0) continue;
    signals = signals.delayed(registration.lost_at_s, registration.lost_s);
    any = true;
  }
  return any;
}

}  // namespace

void align_passes(std::span<const RegisteredPass> passes) {
  std::vector<Aligned> reliable;
  for (const RegisteredPass& pass : passes) {
    if (!pass.registration->reliable) continue;
    if (pass.recording->array != TaxelArray{})
      throw std::invalid_argument(refusal("align_passes", "recording", "the rig's " + TaxelArray{}.text(),
                                          pass.recording->array.text()));
    reliable.push_back({pass.registration, *pass.registration, {*pass.recording, *pass.registration}});
    Registration& r = reliable.back().registration;
    r.shift_mm = r.stretch_mm = r.lost_at_s = r.lost_s = 0;
  }
  if (reliable.size() < kFewestPasses) return;
  align(reliable);
  if (find_losses(reliable)) align(reliable);
  for (const auto& [result, registration, signals] : reliable)
    if (registration.agreement >= kLeastAgreement) *result = moved(registration);
}

}  // namespace supertac
