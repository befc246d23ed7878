// What half a minute of pressing tells about a sensor's body, without any truth.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "data/recordings/recording.h"

namespace supertac {

/// Numbers of a recording of touches that a body decides, whatever touched it: how peaks fall to their
/// neighbours, how that changes with the load, what rows and columns show far from a peak, how fast loads
/// rise, fall and grow. Empty where it has fewer than 100 frames of touch.
std::vector<double> touch_statistics(const Recording& recording);

/// One number of a body: what was found, its standard deviation; or that it could not be told.
struct FittedNumber {
  std::string key;
  double value = 0, deviation = 0;
  bool told = false;
};

/// The sensor with rests, noise and body as the touches show them, and what was found.
struct BodyFit {
  Sensor sensor;
  std::vector<FittedNumber> numbers;
  /// Lines for people: each number with its deviation, and what could not be told and why.
  std::vector<std::string> lines() const;
};

/// Finds bodies of one sensor. Simulates kSimulations arrays like it (its shape and taxels as stated) with
/// bodies drawn from what arrays have - skins of 0.2 to 1.5 pitches, knees from 0.18 on, crosstalk up to 0.5,
/// hysteresis of 0.01 to 1 s, creep up to 0.4 within 0.5 to 10 s, noise of 0.1 to 1 % -, and regresses each
/// number of a body on the statistics of its touches and their squares.
class BodyFitter {
 public:
  static constexpr int kSimulations = 480;
  /// Throws std::runtime_error where half a minute of its frames has too few of a touch.
  BodyFitter(const Sensor& sensor, std::uint64_t seed);
  /// Applies this to touches of the sensor. The deviation is that of the nearest simulated bodies, each left
  /// out of its own regression; a number whose deviation is over 0.6 of what was drawn could not be told:
  /// crosstalk and creep are left out then, since most arrays have none, and the rest is kept with that
  /// deviation, so that simulations vary it as arrays differ. What the sensor's file states without an
  /// uncertainty is known and stays. Noise and rests are measured, the rests from those that the recording
  /// was made with (metadata "rest"). Gains cannot be told from single touches (supertac-stream --probe
  /// --gain). Throws std::runtime_error when there is too little touch, or one that no simulated body shows:
  /// a statistic more than 8 standard deviations off.
  BodyFit operator()(const Recording& touches) const;

 private:
  class Regression;
  Sensor sensor_;
  std::shared_ptr<const Regression> regression_;
};

}  // namespace supertac
