#include "apps/evaluate/page.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/evaluate/score_tables.h"
#include "apps/web/encode.h"
#include "apps/web/result_page.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kApartMm = 3;
constexpr std::uint32_t kApartFrames = 20;
constexpr float kTexture = 0.1F;

}  // namespace

void EvaluationPage::add(const Drawn& d, double ssim) {
  const auto texture = std::count_if(d.target.begin(), d.target.end(), [](float v) { return v > kTexture; });
  contact_.push_back({ssim, d.example, 4 * static_cast<std::size_t>(texture) >= d.target.size()});
}

std::vector<EvaluationPage::ScoredWindow> EvaluationPage::extremes(bool best, const std::string& group,
                                                                   std::size_t most) const {
  std::vector<ScoredWindow> sorted, chosen;
  for (const ScoredWindow& one : contact_)
    if (group.empty() || group_of(windows_.passes()[windows_.pass_of(one.window)]) == group)
      sorted.push_back(one);
  std::sort(sorted.begin(), sorted.end(), [&](const ScoredWindow& a, const ScoredWindow& b) {
    return std::pair(best ? -a.ssim : a.ssim, a.window) < std::pair(best ? -b.ssim : b.ssim, b.window);
  });
  const auto near = [&](const ScoredWindow& a, const ScoredWindow& b) {
    return windows_.pass_of(a.window) == windows_.pass_of(b.window) &&
           (windows_.truth_is_measured(windows_.pass_of(a.window))
                ? std::max(a.window, b.window) - std::min(a.window, b.window) < kApartFrames
                : std::abs(windows_.position(a.window).y_mm - windows_.position(b.window).y_mm) < kApartMm);
  };
  for (const ScoredWindow& one : sorted) {
    if (chosen.size() == most) break;
    if (best && !one.full) continue;  // the edge of a texture is drawn well too easily
    if (std::none_of(chosen.begin(), chosen.end(), [&](const ScoredWindow& c) { return near(c, one); }))
      chosen.push_back(one);
  }
  return chosen;
}

std::string EvaluationPage::name_of(std::uint32_t window) const {
  const WindowSet::Pass& pass = windows_.passes()[windows_.pass_of(window)];
  return (group_of(pass) == pass.plate ? "" : pass.group + ", ") + pass.plate + ", trial " +
         std::to_string(pass.trial) + ", pass " + std::to_string(pass.pass) +
         (pass.speed_mm_s > 0 ? ", " + format(pass.speed_mm_s) + " mm/s" : "");
}

nlohmann::ordered_json EvaluationPage::shown(const std::vector<ScoredWindow>& chosen,
                                             const Ensemble& network) const {
  std::vector<std::uint32_t> which;
  for (const ScoredWindow& one : chosen) which.push_back(one.window);
  const std::vector<ShownWindow> pictures = draw_again(network, windows_, which, {});
  auto json = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < chosen.size(); ++i)
    json.push_back({{"name", name_of(which[i]) + ", " + windows_.place_text(which[i])},
                    {"ssim", chosen[i].ssim},
                    {"psnr_db", psnr_db(mean_squared_error(pictures[i].drawn, pictures[i].truth))},
                    {"felt", levels_base64(pictures[i].input)},
                    {"drawn", levels_base64(pictures[i].drawn)},
                    {"true", levels_base64(pictures[i].truth)}});
  return json;
}

std::string EvaluationPage::html(const Ensemble& network, const nlohmann::ordered_json& result,
                                 const std::vector<std::pair<std::string, std::string>>& made_by) const {
  std::vector<ScoredWindow> of_groups;
  const std::size_t groups = result["groups"].size();
  for (std::size_t i = 0; i < std::min(groups, kGroups) && groups > 1; ++i)
    std::ranges::copy(extremes(false, result["groups"][i]["name"].get<std::string>(), kOfGroup),
                      std::back_inserter(of_groups));
  return result_page({{"title", "SuperTac evaluation"},
                      {"result", result},
                      {"made_by", made_by},
                      {"grouped", has_groups(windows_)},
                      {"rows", windows_.array().rows},
                      {"columns", windows_.array().columns},
                      {"scale", windows_.settings().scale},
                      {"map", colour_map_base64()},
                      {"worst_of_groups", shown(of_groups, network)},
                      {"worst", shown(extremes(false), network)},
                      {"best", shown(extremes(true), network)}});
}

}  // namespace supertac
