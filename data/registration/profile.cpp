#include "data/registration/profile.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "data/recordings/resample.h"

namespace supertac {
namespace {

constexpr std::size_t kColumns = rig::kTaxelColumns;
constexpr double kFromMm = 22, kStepMm = 0.1, kSmoothMm = 1;
constexpr std::size_t kFewestPoints = 200;  // to speak of a correlation
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Mean 0, deviation 1 over the points that are known; all unknown when there are too few or nothing changes.
void standardise(std::array<double, kProfilePoints>& row) {
  double n = 0, sum = 0, squares = 0;
  for (const double v : row)
    if (std::isfinite(v)) n += 1, sum += v, squares += v * v;
  const double mean = sum / n, deviation = std::sqrt(std::max(0.0, squares / n - mean * mean));
  const bool flat = n < kFewestPoints || !(deviation > 1e-6);
  for (double& v : row) v = flat ? kUnknown : (v - mean) / deviation;
}

}  // namespace

PassSignals::PassSignals(const Recording& recording, const Registration& registration) {
  const auto& time = recording.time_s;
  const auto begin = std::lower_bound(time.begin(), time.end(), registration.valid_from_s);
  const auto end = std::upper_bound(begin, time.end(), registration.valid_until_s);
  time_s_.assign(begin, end);
  const auto first = static_cast<std::size_t>(begin - time.begin());
  for (std::size_t row = 0; row < kProfileRows; ++row) {
    std::vector<double> pressed(time_s_.size());
    for (std::size_t i = 0; i < pressed.size(); ++i)
      for (std::size_t column = 0; column < kColumns; ++column) {
        const float v = recording.volts[(first + i) * kTaxels + row * kColumns + column];
        pressed[i] += std::isfinite(v) ? Scaling{}(v) / kColumns : 0;
      }
    sum_[row].assign(pressed.size() + 1, 0);
    for (std::size_t i = 0; i < pressed.size(); ++i) sum_[row][i + 1] = sum_[row][i] + pressed[i];
  }
}

PassSignals PassSignals::delayed(double at_s, double seconds) const {
  PassSignals later = *this;
  for (double& t : later.time_s_) t += t >= at_s ? seconds : 0;
  return later;
}

Profile PassSignals::along(const Registration& r) const {
  Profile profile;
  std::size_t from = 0, to = 0;
  for (std::size_t point = 0; point < kProfilePoints; ++point) {
    const double y = kFromMm + static_cast<double>(point) * kStepMm;
    while (from < time_s_.size() && r.start_mm + r.rate * time_s_[from] < y - kSmoothMm) ++from;
    while (to < time_s_.size() && r.start_mm + r.rate * time_s_[to] <= y + kSmoothMm) ++to;
    const bool known = from > 0 && to < time_s_.size() && from < to;
    for (std::size_t row = 0; row < kProfileRows; ++row)
      profile[row][point] =
          known ? (sum_[row][to] - sum_[row][from]) / static_cast<double>(to - from) : kUnknown;
  }
  for (auto& row : profile) standardise(row);
  return profile;
}

Profile mean_of_others(const std::vector<Profile>& profiles, std::size_t left_out) {
  Profile mean;
  for (std::size_t row = 0; row < kProfileRows; ++row)
    for (std::size_t point = 0; point < kProfilePoints; ++point) {
      double n = 0, sum = 0;
      for (std::size_t i = 0; i < profiles.size(); ++i)
        if (const double v = profiles[i][row][point]; i != left_out && std::isfinite(v)) n += 1, sum += v;
      mean[row][point] = n > 0 ? sum / n : kUnknown;
    }
  return mean;
}

// Pearson's, mean over the rows that both know.
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

}  // namespace supertac
