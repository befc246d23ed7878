#pragma once

#include "apps/train/run_folder.h"

namespace supertac {

/// Sums of the steps since the last line of the log.
class LogMeans {
 public:
  static constexpr std::int64_t kSteps = 50;  ///< per line

  void add(const StepReport& r) {
    ++steps_;
    total_ += r.total, reconstruction_ += r.reconstruction, kld_ += r.kld, l2_ += r.l2, ssim_ += r.ssim;
    norm_ += r.gradient_norm;
    last_ = r;
  }
  LogLine take(double seconds) {
    const double n = static_cast<double>(steps_);
    const LogLine line{seconds, last_.step, total_ / n, reconstruction_ / n, kld_ / n,
                       l2_ / n, ssim_ / n,  norm_ / n,  last_.learning_rate, {},
                       {}};
    *this = LogMeans();
    return line;
  }

 private:
  std::int64_t steps_ = 0;
  double total_ = 0, reconstruction_ = 0, kld_ = 0, l2_ = 0, ssim_ = 0, norm_ = 0;
  StepReport last_;
};

}  // namespace supertac
