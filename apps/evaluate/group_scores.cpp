#include "apps/evaluate/group_scores.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/numbers/numbers.h"

namespace supertac {

GroupScores::GroupScores(const WindowSet& windows)
    : windows_(windows), by_group_(std::ranges::any_of(windows.passes(), [](const WindowSet::Pass& pass) {
        return !pass.group.empty();
      })) {}

void GroupScores::add(std::uint32_t window, std::span<const float> picture, std::span<const float> truth) {
  const WindowSet::Pass& pass = windows_.passes()[windows_.pass_of(window)];
  groups_.try_emplace(by_group_ ? pass.group : pass.plate, windows_.image())
      .first->second.add(picture, truth, windows_.zone(window), windows_.contact_level());
}

std::vector<std::pair<std::string, const ZoneMetrics*>> GroupScores::worst_first() const {
  std::vector<std::pair<std::string, const ZoneMetrics*>> order;
  for (const auto& [name, metrics] : groups_) order.emplace_back(name, &metrics);
  std::ranges::stable_sort(order, {}, [](const auto& group) {
    const double ssim = group.second->contact().ssim;
    return std::isfinite(ssim) ? ssim : 2;
  });
  return order;
}

std::vector<std::string> GroupScores::lines() const {
  constexpr std::size_t kMost = 8;
  std::vector<std::string> lines;
  if (groups_.size() < 2) return lines;
  for (const auto& [name, metrics] : worst_first()) {
    const Metrics contact = metrics->contact();
    if (lines.size() == kMost) {
      lines.push_back("... and " + std::to_string(groups_.size() - kMost) + " more, better ones");
      break;
    }
    if (contact.windows > 0)
      lines.push_back((by_group_ ? "group " : "plate ") + name + ": contact SSIM " + format(contact.ssim, 3) +
                      ", PSNR " + format(contact.psnr_mean_db, 2) + " dB, " +
                      std::to_string(contact.windows) + " windows");
  }
  return lines;
}

nlohmann::ordered_json GroupScores::to_json() const {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const auto& [name, metrics] : worst_first())
    json.push_back({{"name", name},
                    {"contact", supertac::to_json(metrics->contact())},
                    {"all", supertac::to_json(metrics->all())}});
  return json;
}

std::vector<std::string> remarks_on_scores(const nlohmann::ordered_json& result, const GroupScores& groups) {
  constexpr double kHardly = 0.02, kCoin = 0.5;
  constexpr std::size_t kFew = 3;
  std::vector<std::string> remarks;
  const auto ssim_of = [](const nlohmann::ordered_json& scores) {
    const auto& ssim = scores["contact"]["ssim"];
    return ssim.is_number() ? ssim.get<double>() : Metrics::kNone;
  };
  const double own = ssim_of(result);
  if (result.contains("baselines") && result["baselines"].contains("ridge"))
    if (const double ridge = ssim_of(result["baselines"]["ridge"]); own < ridge + kHardly)
      remarks.push_back("the network's contact SSIM, " + format(own, 3) +
                        ", is hardly above that of ridge regression, " + format(ridge, 3) +
                        ": more or other recordings, or longer training, would have to help");
  if (const auto& trust = result["trust"]; trust.contains("auroc") && trust["auroc"].is_number())
    if (const double auroc = trust["auroc"].get<double>(); auroc < kCoin)
      remarks.push_back("predicted errors tell less than a coin which pictures are bad (AUROC " +
                        format(auroc, 3) + "): do not rely on them here");
  if (groups.by_group() && groups.size() < kFew)
    remarks.push_back(std::to_string(groups.size()) + (groups.size() == 1 ? " group was" : " groups were") +
                      " tested: others may be drawn much better or worse; --split group --leave-out NAME of "
                      "supertac-train tests each in turn");
  return remarks;
}

}  // namespace supertac
