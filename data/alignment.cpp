#include "data/alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "data/resample.h"

namespace supertac {
namespace {

constexpr size_t kRows = 4, kColumns = 4;
constexpr double kFromMm = 22, kToMm = 92, kStepMm = 0.1, kSmoothMm = 1;
constexpr size_t kPoints = static_cast<size_t>((kToMm - kFromMm) / kStepMm) + 1;
constexpr size_t kFewestPoints = 200;  // to speak of a correlation
constexpr double kMiddleMm = 54, kHalfMm = 26;
constexpr double kPenalty = 0.002, kUsualShiftMm = 0.5, kUsualStretchMm = 1;
constexpr double kFirstStepMm = 0.4, kLastStepMm = 0.01;
constexpr int kRounds = 6;
constexpr size_t kFewestPasses = 3;
constexpr double kLeastAgreement = 0.5;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct Change {
  double shift_mm = 0, stretch_mm = 0;
};

// y' = y + a + b (y - 54) / 26 of y = start + rate t is a line again.
Registration changed(Registration r, const Change& change) {
  const double stretch = change.stretch_mm / kHalfMm;
  r.start_mm += change.shift_mm + stretch * (r.start_mm - kMiddleMm);
  r.rate *= 1 + stretch;
  return r;
}

using Row = std::array<double, kPoints>;
using Profile = std::array<Row, kRows>;

// Mean 0, deviation 1 over the points that are known; all unknown when there are too few or nothing changes.
void standardise(Row& row) {
  double n = 0, sum = 0, squares = 0;
  for (const double v : row)
    if (std::isfinite(v)) n += 1, sum += v, squares += v * v;
  const double mean = sum / n, deviation = std::sqrt(std::max(0.0, squares / n - mean * mean));
  const bool flat = n < kFewestPoints || !(deviation > 1e-6);
  for (double& v : row) v = flat ? kUnknown : (v - mean) / deviation;
}

// How far each row is pressed, over time.
class Signals {
 public:
  Signals(const Recording& recording, const Registration& registration) {
    const auto& time = recording.time_s;
    const auto begin = std::lower_bound(time.begin(), time.end(), registration.valid_from_s);
    const auto end = std::upper_bound(begin, time.end(), registration.valid_until_s);
    time_s_.assign(begin, end);
    const auto first = static_cast<size_t>(begin - time.begin());
    for (size_t row = 0; row < kRows; ++row) {
      std::vector<double> pressed(time_s_.size());
      for (size_t i = 0; i < pressed.size(); ++i)
        for (size_t column = 0; column < kColumns; ++column) {
          const float v = recording.volts[(first + i) * kTaxels + row * kColumns + column];
          pressed[i] += std::isfinite(v) ? Scaling{}(v) / kColumns : 0;
        }
      sum_[row].assign(pressed.size() + 1, 0);
      for (size_t i = 0; i < pressed.size(); ++i) sum_[row][i + 1] = sum_[row][i] + pressed[i];
    }
  }

  Profile along(const Registration& r) const {
    Profile profile;
    size_t from = 0, to = 0;
    for (size_t point = 0; point < kPoints; ++point) {
      const double y = kFromMm + static_cast<double>(point) * kStepMm;
      while (from < time_s_.size() && r.start_mm + r.rate * time_s_[from] < y - kSmoothMm) ++from;
      while (to < time_s_.size() && r.start_mm + r.rate * time_s_[to] <= y + kSmoothMm) ++to;
      const bool known = from > 0 && to < time_s_.size() && from < to;
      for (size_t row = 0; row < kRows; ++row)
        profile[row][point] =
            known ? (sum_[row][to] - sum_[row][from]) / static_cast<double>(to - from) : kUnknown;
    }
    for (Row& row : profile) standardise(row);
    return profile;
  }

 private:
  std::vector<double> time_s_;
  std::array<std::vector<double>, kRows> sum_;  // of all frames before
};

Profile mean_of_others(const std::vector<Profile>& profiles, size_t left_out) {
  Profile mean;
  for (size_t row = 0; row < kRows; ++row)
    for (size_t point = 0; point < kPoints; ++point) {
      double n = 0, sum = 0;
      for (size_t i = 0; i < profiles.size(); ++i)
        if (const double v = profiles[i][row][point]; i != left_out && std::isfinite(v)) n += 1, sum += v;
      mean[row][point] = n > 0 ? sum / n : kUnknown;
    }
  return mean;
}

// Pearson's, mean over the rows that both know.
double correlation(const Profile& a, const Profile& b) {
  double rows = 0, total = 0;
  for (size_t row = 0; row < kRows; ++row) {
    double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
    for (size_t point = 0; point < kPoints; ++point) {
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

struct Found {
  Change change;
  double agreement = -1;
};

// Pattern search (Hooke & Jeeves 1961): steps along a and b, halved when none is better.
Found best_change(const Signals& signals, const Registration& registration, const Profile& others,
                  const Change& start) {
  const auto score = [&](const Change& c, double& agreement) {
    agreement = correlation(signals.along(changed(registration, c)), others);
    const double shift = c.shift_mm / kUsualShiftMm, stretch = c.stretch_mm / kUsualStretchMm;
    return agreement - kPenalty * (shift * shift + stretch * stretch);
  };
  Found best{.change = start};
  double highest = score(start, best.agreement);
  for (double step = kFirstStepMm; step >= kLastStepMm;) {
    bool better = false;
    for (const Change& move : {Change{step, 0}, Change{-step, 0}, Change{0, step}, Change{0, -step}}) {
      Found tried{.change = {best.change.shift_mm + move.shift_mm, best.change.stretch_mm + move.stretch_mm}};
      const double value = score(tried.change, tried.agreement);
      if (value > highest) highest = value, best = tried, better = true;
    }
    if (!better) step /= 2;
  }
  return best;
}

void take_medians_off(std::vector<Found>& found) {
  std::vector<double> shifts, stretches;
  for (const Found& f : found) {
    shifts.push_back(f.change.shift_mm);
    stretches.push_back(f.change.stretch_mm);
  }
  const double shift = median(shifts), stretch = median(stretches);
  for (Found& f : found) f.change.shift_mm -= shift, f.change.stretch_mm -= stretch;
}

}  // namespace

void align_passes(std::span<const RegisteredPass> passes) {
  std::vector<Registration*> registrations;
  std::vector<Signals> signals;
  for (const RegisteredPass& pass : passes) {
    if (!pass.registration->reliable) continue;
    if (pass.recording->array != TaxelArray{})
      throw std::invalid_argument("align_passes: expected recordings of the rig's 4x4 array, found another");
    registrations.push_back(pass.registration);
    signals.emplace_back(*pass.recording, *pass.registration);
  }
  const size_t n = signals.size();
  if (n < kFewestPasses) return;

  std::vector<Found> found(n);
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Profile> profiles;
    for (size_t i = 0; i < n; ++i)
      profiles.push_back(signals[i].along(changed(*registrations[i], found[i].change)));
    for (size_t i = 0; i < n; ++i)
      found[i] = best_change(signals[i], *registrations[i], mean_of_others(profiles, i), found[i].change);
    take_medians_off(found);
  }
  for (size_t i = 0; i < n; ++i) {
    if (found[i].agreement < kLeastAgreement) continue;
    *registrations[i] = changed(*registrations[i], found[i].change);
    registrations[i]->shift_mm = found[i].change.shift_mm;
    registrations[i]->stretch_mm = found[i].change.stretch_mm;
    registrations[i]->agreement = found[i].agreement;
  }
}

}  // namespace supertac
