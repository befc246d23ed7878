// What the array feels, without any model.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "apps/stream/live_frame.h"
#include "apps/stream/sensor_source.h"

namespace supertac {

/// The array as it is: how far each taxel is from its own rest, on a scale that follows what is seen.
class RawArray {
 public:
  explicit RawArray(const SensorSource& source);
  void push(std::span<const float> signals);
  /// What each signal was in the last moments (kRestS), as a mean.
  const std::vector<double>& resting() const { return newest_mean_; }
  /// That is its rest from now on.
  void rezero() { rest_ = newest_mean_; }
  /// [rows][columns] in [0,1]: the mean of a taxel's channels, as far in the pressed direction as top() is.
  /// Three axes of a field have no direction: there it is the length of the change.
  std::vector<float> taxels() const;
  /// What 1 stands for, in the sensor's unit: the most that was seen, which is forgotten within kForgetS; at
  /// least a twentieth of the stated range.
  double top() const { return top_; }
  /// The signal that is farthest from its rest, either way: where the finger is, also when polarity or order
  /// are wrong. Empty when none is a twentieth of the stated range away.
  std::optional<ChangedSignal> most_changed() const;
  /// Of each taxel how far it is from its rest, either way, as a mean over the last moments (kRestS).
  std::vector<double> loads() const;

 private:
  static constexpr double kRestS = 0.2, kForgetS = 20, kLeastTop = 0.05;
  double pressed(std::size_t taxel) const;

  TaxelArray array_;
  double direction_, period_s_, least_top_, top_;
  std::size_t frames_ = 0;
  std::vector<double> rest_, newest_mean_;
  std::vector<float> newest_;
};

}  // namespace supertac
