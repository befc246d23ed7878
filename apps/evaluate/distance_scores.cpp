#include "apps/evaluate/distance_scores.h"

#include <cmath>

#include "data/scores/metrics.h"
#include "io/numbers/numbers.h"

namespace supertac {

void DistanceScores::add(std::uint32_t window, std::span<const float> output, std::span<const float> truth) {
  if (!windows_.contact(window)) return;
  const WindowSet::Position here = windows_.position(window);
  if (windows_.pass_of(window) != pass_) {
    pass_ = windows_.pass_of(window);
    begin_ = here;
  }
  const double slid = std::hypot(here.x_mm - begin_.x_mm, here.y_mm - begin_.y_mm);
  if (!std::isfinite(slid)) return;  // nobody knows where it was
  std::size_t p = parts_.size() - 1;
  while (p > 0 && slid < parts_[p].from_mm) --p;
  const ImageGrid grid = windows_.image();
  parts_[p].ssim += ssim(output, truth, grid.height, grid.width);
  parts_[p].psnr += psnr_db(mean_squared_error(output, truth));
  ++parts_[p].windows;
}

std::vector<std::string> DistanceScores::lines() const {
  std::vector<std::string> lines;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    if (parts_[p].windows == 0) continue;
    const auto n = static_cast<double>(parts_[p].windows);
    const std::string to =
        p + 1 < parts_.size() ? " to " + format(parts_[p + 1].from_mm, 0) + " mm" : " mm or more";
    lines.push_back(format(parts_[p].from_mm, 0) + to + " after the first contact: SSIM " +
                    format(parts_[p].ssim / n, 3) + ", PSNR " + format(parts_[p].psnr / n, 2) + " dB, " +
                    std::to_string(parts_[p].windows) + " windows");
  }
  return lines;
}

nlohmann::ordered_json DistanceScores::to_json() const {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Part& part : parts_) {
    if (part.windows == 0) continue;
    const auto n = static_cast<double>(part.windows);
    json.push_back({{"from_mm", part.from_mm},
                    {"windows", part.windows},
                    {"ssim", part.ssim / n},
                    {"psnr_mean_db", part.psnr / n}});
  }
  return json;
}

}  // namespace supertac
