// Which taxels of a simulated array feel anything.
#pragma once

#include <string>
#include <vector>

#include "data/recordings/recording.h"

namespace supertac {

/// Gathers over recordings how far each taxel's signals go. A simulation whose body does not fit its scenes
/// leaves taxels with noise and drift alone, which stay within a tenth of the range.
class FeltTaxels {
 public:
  void add(const Recording& recording);
  /// Of the simulated recordings, all of one array: those whose signals stay within a tenth of the range.
  /// None while nothing simulated was added.
  std::vector<int> unfelt() const;
  /// "49 of 60 taxels feel nothing: 0-9, 12; ..." and what helps, where that holds of more than three
  /// quarters: of a dome that slides over one strip of a plate half of the taxels feel it. Else nothing.
  std::string complaint() const;
  /// Throws std::runtime_error with the complaint where there is one.
  void check() const;

 private:
  TaxelArray array_;
  double span_ = 0;
  bool flat_ = true;
  std::vector<float> low_, high_;  // of each signal
};

}  // namespace supertac
