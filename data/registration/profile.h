#pragma once

#include <array>
#include <vector>

#include "data/recordings/recording.h"
#include "data/registration/registration.h"

namespace supertac {

/// How far each of the four taxel rows is pressed along the plate: [row][point], the points every 0.1 mm from
/// y = 22 to 92 mm. Each row has mean 0 and deviation 1; NaN where nothing is known.
constexpr std::size_t kProfileRows = rig::kTaxelRows, kProfilePoints = 701;
using Profile = std::array<std::array<double, kProfilePoints>, kProfileRows>;

/// The signals of a pass, prepared for many calls of along().
class PassSignals {
 public:
  /// Those between the registration's valid_from_s and valid_until_s.
  PassSignals(const Recording& recording, const Registration& registration);

  const std::vector<double>& time_s() const { return time_s_; }
  /// The same signals, later by `seconds` from at_s on.
  PassSignals delayed(double at_s, double seconds) const;
  /// Each row's mean within 1 mm of each point, by start_mm and rate of a registration. A row is unknown
  /// where fewer than 200 points are, or nothing changes.
  Profile along(const Registration& registration) const;

 private:
  std::vector<double> time_s_;
  std::array<std::vector<double>, kProfileRows> sum_;  // of all frames before
};

/// The mean of all profiles but one.
Profile mean_of_others(const std::vector<Profile>& profiles, std::size_t left_out);

/// Pearson's correlation, mean over the rows in which both know 200 points; -1 when there is no such row.
double correlation(const Profile& a, const Profile& b);

}  // namespace supertac
