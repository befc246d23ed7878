// "order" of a sensor's file, from a finger that presses the places of the array in turn.
#pragma once

#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/sensors/sensor.h"

namespace supertac {

/// Asks for the places of an array in turn, row by row, and takes for each the taxel whose load a press
/// raised the most. A press begins where a load is 5 % of the range above its least since the press before,
/// and ends where no load is above a third of the press's highest. A place is asked for again where a second
/// taxel reached four fifths of the first, or the first has been pressed for another place. A place that is
/// skipped has a dead taxel, or none where a frame has fewer values than the array places. After the last one
/// the file gets the order; rest and gain follow (Sensor::reorder). Any thread may call.
class PressedOrder {
 public:
  /// `draft`: what the file at `path` holds; empty: there is none. `silent`: taxels whose loads are others'.
  PressedOrder(const Sensor& draft, std::vector<int> silent, std::string path)
      : draft_(draft), silent_(std::move(silent)), path_(std::move(path)) {}

  // These answer with a line for people. leave(): the file stays as it was.
  std::string start();
  std::string skip();
  std::string leave();
  /// `loads` [taxel], from rest, in the sensor's unit.
  void push(std::span<const double> loads);

  struct Status {
    std::optional<int> asked;  ///< the place that is to be pressed
    std::string says;          ///< why it is asked for again, or what became of the last order
  };
  Status status() const;

 private:
  void answer();
  void take(int taxel);
  void write() const;

  Sensor draft_;
  std::vector<int> silent_;
  std::string path_, says_;
  mutable std::mutex mutex_;
  bool asks_ = false;
  std::vector<int> pressed_;           // by place: the taxel, -1 where it was skipped
  std::vector<double> least_, peaks_;  // of each taxel since the press before
};

}  // namespace supertac
