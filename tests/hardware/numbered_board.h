// A virtual board whose taxels carry the number of their frame, so that frames are compared with the truth by
// it and never by time.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "hardware/printers/palpation.h"
#include "tests/hardware/virtual_rig/rig_world.h"

namespace supertac {

/// Where the head was in the middle of every frame, by the frame's number, which the taxels carry eight
/// times. Must outlive the rig.
class NumberedBoard {
 public:
  explicit NumberedBoard(RigSettings& settings) {
    settings.signals = [this](double, double, double, double) {
      std::array<double, rig::kTaxels> volts{};
      const std::uint64_t number = heads_.size() - 1;
      for (std::size_t k = 0; k < volts.size(); k += 2) {
        volts[k] = rig::volts_of(static_cast<int>(number % kWord));
        volts[k + 1] = rig::volts_of(static_cast<int>(number / kWord));
      }
      return volts;
    };
  }
  void watch(VirtualBoard& board) {
    board.on_frame([this](const Point3& head) { heads_.push_back(head); });
  }
  /// The numbers that three copies at least agree on: two in a torn frame. Two copies may be flipped alike.
  std::vector<std::uint64_t> numbers_in(const std::function<int(std::size_t)>& taxel) const {
    std::map<std::uint64_t, int> copies;
    for (std::size_t k = 0; k < rig::kTaxels; k += 2)
      ++copies[static_cast<std::uint64_t>(taxel(k)) + kWord * static_cast<std::uint64_t>(taxel(k + 1))];
    std::vector<std::uint64_t> numbers;
    for (const auto& [number, count] : copies)
      if (count >= 3 && number < heads_.size()) numbers.push_back(number);
    return numbers;
  }
  /// Of frame i of volts [n][16].
  std::vector<std::uint64_t> numbers_in(std::span<const float> volts, std::size_t i) const {
    return numbers_in([&](std::size_t k) { return rig::adc_of(double{volts[rig::kTaxels * i + k]}); });
  }
  const Point3& head(std::uint64_t number) const { return heads_[number]; }
  const std::vector<Point3>& heads() const { return heads_; }

 private:
  static constexpr std::uint64_t kWord = rig::kAdcCodes;  // of a sample
  std::vector<Point3> heads_;
};

}  // namespace supertac
