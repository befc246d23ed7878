#include "apps/evaluate/pass_scores.h"

#include <algorithm>

#include "data/scores/metrics.h"
#include "io/numbers/numbers.h"

namespace supertac {

void PassScores::add(std::uint32_t window, std::span<const float> output, std::span<const float> truth) {
  if (!windows_.contact(window)) return;
  const ImageGrid grid = windows_.image();
  Sums& sums = passes_[windows_.pass_of(window)];
  sums.ssim += ssim(output, truth, grid.height, grid.width);
  sums.psnr += psnr_db(mean_squared_error(output, truth));
  ++sums.windows;
}

std::array<Interval, 2> PassScores::intervals() const {
  std::vector<ClusterCount> ssims, psnrs;
  std::vector<std::size_t> plates;
  std::vector<std::string> names;
  for (const auto& [pass, sums] : passes_) {
    const std::string& plate = windows_.passes()[pass].plate;
    auto at = std::ranges::find(names, plate);
    if (at == names.end()) at = names.insert(names.end(), plate);
    plates.push_back(static_cast<std::size_t>(at - names.begin()));
    ssims.push_back({sums.ssim, sums.windows}), psnrs.push_back({sums.psnr, sums.windows});
  }
  return {bootstrap_interval({&ssims, 1}, plates), bootstrap_interval({&psnrs, 1}, plates)};
}

std::string PassScores::interval_text() const {
  if (passes_.size() < 2) return "";
  const auto [ssim, psnr] = intervals();
  return "SSIM " + format(ssim.low, 3) + " to " + format(ssim.high, 3) + ", PSNR " + format(psnr.low, 2) +
         " to " + format(psnr.high, 2) + " dB";
}

nlohmann::ordered_json PassScores::to_json() const {
  nlohmann::ordered_json json;
  if (passes_.size() > 1) {
    const auto [ssim, psnr] = intervals();
    json["ssim"] = {ssim.low, ssim.high}, json["psnr_mean_db"] = {psnr.low, psnr.high};
  }
  json["passes"] = nlohmann::ordered_json::array();
  for (const auto& [pass, sums] : passes_) {
    const WindowSet::Pass& p = windows_.passes()[pass];
    json["passes"].push_back({{"plate", p.plate},
                              {"trial", p.trial},
                              {"pass", p.pass},
                              {"windows", sums.windows},
                              {"ssim", sums.ssim / sums.windows},
                              {"psnr_mean_db", sums.psnr / sums.windows}});
  }
  return json;
}

}  // namespace supertac
