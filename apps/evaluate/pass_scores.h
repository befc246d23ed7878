// How good pictures are by pass, and how sure that is.
#pragma once

#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "data/scores/statistics.h"
#include "data/windows/windows.h"

namespace supertac {

/// Mean SSIM and PSNR of windows in contact, by pass. Windows of one pass resemble each other, so the
/// intervals are over passes, drawn anew within each plate: they say what other passes over these plates
/// would give, of this one network.
class PassScores {
 public:
  explicit PassScores(const WindowSet& windows) : windows_(windows) {}
  /// Those not in contact are left out.
  void add(std::uint32_t window, std::span<const float> output, std::span<const float> truth);
  /// "SSIM 0.81 to 0.84, PSNR 20.1 to 21.0 dB", 95 %; empty where fewer than two passes were in contact.
  std::string interval_text() const;
  /// {"ssim": [low, high], "psnr_mean_db": [low, high], "passes": [{"plate", "trial", "pass", "windows",
  /// "ssim", "psnr_mean_db"}, ...]}; without the intervals where they are not known
  nlohmann::ordered_json to_json() const;

 private:
  struct Sums {
    double ssim = 0, psnr = 0, windows = 0;
  };
  std::array<Interval, 2> intervals() const;

  const WindowSet& windows_;
  std::map<std::size_t, Sums> passes_;
};

}  // namespace supertac
