#include "apps/evaluate/scoring.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>

#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "data/scores/statistics.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/evaluation.h"
#include "models/inference/novelty.h"

namespace supertac {
namespace {

// What decides which windows a split tests.
std::string drawn_by(const ModelFile& file) {
  const std::string plate = value_or(file.metadata, "leave_out");
  return plate.empty() ? "seed " + value_or(file.metadata, "seed", "0") : "left-out plate " + plate;
}

bool is_drawn(const std::string& split) { return split != "trial" && split != "none"; }

// Whether the windows that are tested are not those that this model's training kept away.
bool is_another(const TestSet& tested, const ModelFile& file) {
  const bool by_seed = is_drawn(tested.split_name) && value_or(file.metadata, "leave_out").empty();
  return tested.split_name != value_or(file.metadata, "split", "none") ||
         (by_seed && std::to_string(tested.seed) != value_or(file.metadata, "seed", "0"));
}

void refuse_leak(const std::vector<ModelFile>& files, const std::string& split_name) {
  const std::string split = value_or(files.front().metadata, "split", "none");
  for (const ModelFile& file : files)
    if (const std::string other = value_or(file.metadata, "split", "none"); other != split)
      throw std::runtime_error(
          "one model was trained with split " + split + ", another with " + other +
          ": what one is tested on the other may have seen; average models of one split");
  if (!is_drawn(split_name)) return;
  for (const ModelFile& file : files)
    if (drawn_by(file) != drawn_by(files.front()))
      throw std::runtime_error("split " + split_name + " of one model was drawn by " +
                               drawn_by(files.front()) + ", of another by " + drawn_by(file) +
                               ": what one is tested on the other has seen; average models of one split");
}

/// Over some windows in contact.
struct ScoreSums {
  double ssim = 0, psnr = 0;
  std::uint64_t windows = 0;
  void add(const ContactScore& one) { ssim += one.ssim, psnr += one.psnr_db, ++windows; }
  nlohmann::ordered_json to_json() const {
    const auto count = static_cast<double>(windows);
    return {{"windows", windows}, {"ssim", ssim / count}, {"psnr_mean_db", psnr / count}};
  }
};
using PassSums = std::map<std::size_t, ScoreSums>;

PassSums sums_of(const WindowSet& windows, std::span<const ContactScore> scores) {
  PassSums passes;
  for (const ContactScore& one : scores) passes[windows.pass_of(one.window)].add(one);
  return passes;
}

/// Of SSIM and PSNR.
std::array<Interval, 2> intervals_of(const WindowSet& windows, const PassSums& passes) {
  std::vector<ClusterCount> ssims, psnrs;
  std::vector<std::size_t> plates;
  std::vector<std::string> names;
  for (const auto& [pass, sums] : passes) {
    const std::string& plate = windows.passes()[pass].plate;
    auto at = std::ranges::find(names, plate);
    if (at == names.end()) at = names.insert(names.end(), plate);
    plates.push_back(static_cast<std::size_t>(at - names.begin()));
    const auto count = static_cast<double>(sums.windows);
    ssims.push_back({sums.ssim, count}), psnrs.push_back({sums.psnr, count});
  }
  // Groups of a pass each are drawn themselves: one pass drawn anew within its plate is always the same.
  if (names.size() == passes.size()) std::ranges::fill(plates, 0);
  return {bootstrap_interval(ssims, plates), bootstrap_interval(psnrs, plates)};
}

}  // namespace

TestSet test_set_of(const Arguments& a, const ModelFile& file) {
  return {a.given("split") ? a.choice("split", {"window", "pass", "trial", "texture", "group", "none"})
                           : value_or(file.metadata, "split", "none"),
          a.given("seed") ? a.seed() : parse_uint(value_or(file.metadata, "seed", "0")).value_or(0),
          comma_list(value_or(file.metadata, "leave_out")),
          {}};
}

void check_test_set(const Arguments& a, const std::vector<ModelFile>& files, const WindowSet& windows,
                    TestSet& tested) {
  // Who asks for every window knows what the models have seen.
  if (!a.given("split") || tested.split_name != "none") refuse_leak(files, tested.split_name);
  if (!a.given("split") && tested.split_name == "none")
    a.note(
        "the model was trained with split none: if these are the recordings of its training, it has seen "
        "every one of them");
  const std::string own = value_or(files.front().metadata, "split", "none");
  const auto said = [](const std::string& split, const std::string& by) {
    return is_drawn(split) ? split + " (" + by + ")" : split;
  };
  if (own != "none" && tested.split_name != "none" && is_another(tested, files.front()))
    a.note(
        "the model was trained with split " + said(own, drawn_by(files.front())) + ", tested is split " +
        said(tested.split_name, "seed " + std::to_string(tested.seed)) +
        ": if these are the recordings of its training, it has seen some of these windows; without --split "
        "and --seed those that it has not seen are tested");
  if (!a.given("split") && files.front().metadata.contains("interval_factor_found"))
    a.note("the factor of the intervals was found on these groups: that they hold here is no measurement");
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const auto history = static_cast<std::size_t>(a.integer("history", 0, kMost));
  std::erase_if(tested.split.test, [&](std::uint32_t i) { return windows.history(i) < history; });
  if (tested.split.test.empty())
    throw UsageError("--history " + a.text("history") + " leaves none of the test windows; give less");
  const auto limit = static_cast<std::size_t>(a.integer("limit", 0, kMost));
  if (limit > 0) tested.split.test = evenly_spaced(tested.split.test, limit);
  if (tested.split.train.empty())
    throw std::runtime_error(
        "the split leaves nothing to fit the baselines on; --split none fits them to what is tested");
}

void draw_all(const Arguments& a, const Ensemble& network, const WindowSet& windows,
              std::span<const std::uint32_t> test, const Baselines& baselines,
              const std::function<void(const Drawn&)>& use) {
  std::vector<std::vector<float>> plain(baselines.size(), std::vector<float>(windows.image().pixels()));
  Progress progress(a, "evaluating", test.size(), "pictures");
  for_each_output(network, windows, test, [&](const EvaluatedBatch& b) {
    for (std::size_t n = 0; n < b.size(); ++n) {
      Drawn drawn{test[b.first + n], b.target(n), {b.output(n)}, b.predicted_error(n), b.input(n)};
      for (std::size_t k = 0; k < baselines.size(); ++k) {
        baselines[k]->predict(b.input(n), plain[k]);
        drawn.pictures.push_back(plain[k]);
      }
      use(drawn);
    }
    progress.update(b.first + b.size());
    return !interrupted();
  });
  stop_if_interrupted();
}

std::optional<ContactScore> contact_score(const WindowSet& windows, std::uint32_t window,
                                          std::span<const float> picture, std::span<const float> truth) {
  constexpr float kTexture = 0.1F;
  if (!windows.contact(window)) return std::nullopt;
  const ImageGrid grid = windows.image();
  const auto texture = std::ranges::count_if(truth, [](float v) { return v > kTexture; });
  return ContactScore{window, ssim(picture, truth, grid.height, grid.width),
                      psnr_db(mean_squared_error(picture, truth)), 4 * texture >= std::ssize(truth)};
}

nlohmann::ordered_json scores_by_distance(const WindowSet& windows, std::span<const ContactScore> scores) {
  constexpr std::array kFromMm{0, 5, 10, 15, 20, 30};
  std::array<ScoreSums, kFromMm.size()> parts;
  std::size_t pass = SIZE_MAX;
  WindowSet::Position begin{};
  for (const ContactScore& one : scores) {
    const WindowSet::Position here = windows.position(one.window);
    if (windows.pass_of(one.window) != pass) pass = windows.pass_of(one.window), begin = here;
    const double slid = std::hypot(here.x_mm - begin.x_mm, here.y_mm - begin.y_mm);
    if (!std::isfinite(slid)) continue;  // nobody knows where it was
    std::size_t p = parts.size() - 1;
    while (p > 0 && slid < kFromMm[p]) --p;
    parts[p].add(one);
  }
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (parts[p].windows == 0) continue;
    json.push_back({{"from_mm", static_cast<double>(kFromMm[p])}});
    json.back().update(parts[p].to_json());
  }
  return json;
}

nlohmann::ordered_json scores_by_pass(const WindowSet& windows, std::span<const ContactScore> scores) {
  const PassSums passes = sums_of(windows, scores);
  nlohmann::ordered_json json;
  if (passes.size() > 1) {
    const auto [ssim, psnr] = intervals_of(windows, passes);
    json["ssim"] = {ssim.low, ssim.high}, json["psnr_mean_db"] = {psnr.low, psnr.high};
  }
  json["passes"] = nlohmann::ordered_json::array();
  for (const auto& [pass, sums] : passes) {
    const WindowSet::Pass& p = windows.passes()[pass];
    json["passes"].push_back({{"plate", p.plate}, {"trial", p.trial}, {"pass", p.pass}});
    json["passes"].back().update(sums.to_json());
  }
  return json;
}

std::string interval_text(const WindowSet& windows, std::span<const ContactScore> scores) {
  const PassSums passes = sums_of(windows, scores);
  if (passes.size() < 2) return "";
  const auto [ssim, psnr] = intervals_of(windows, passes);
  return "SSIM " + format(ssim.low, 3) + " to " + format(ssim.high, 3) + ", PSNR " + format(psnr.low, 2) +
         " to " + format(psnr.high, 2) + " dB";
}

const std::string& group_of(const WindowSet::Pass& pass) {
  return pass.group.empty() ? pass.plate : pass.group;
}
bool has_groups(const WindowSet& windows) {
  return std::ranges::any_of(windows.passes(), [](const auto& pass) { return !pass.group.empty(); });
}

void GroupScores::add(std::uint32_t window, std::span<const float> picture, std::span<const float> truth) {
  groups_.try_emplace(group_of(windows_.passes()[windows_.pass_of(window)]), windows_.image())
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
      lines.push_back((by_group() ? "group " : "plate ") + name + ": contact SSIM " +
                      format(contact.ssim, 3) + ", PSNR " + format(contact.psnr_mean_db, 2) + " dB, " +
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
  // With split none ridge regression was fitted to what is tested.
  if (result["split"] != "none" && result.contains("baselines") && result["baselines"].contains("ridge"))
    if (const double ridge = ssim_of(result["baselines"]["ridge"]); own < ridge + kHardly)
      remarks.push_back("the network's contact SSIM, " + format(own, 3) +
                        ", is hardly above that of ridge regression, " + format(ridge, 3) +
                        ": more or other recordings, or longer training, would have to help");
  if (const auto& auroc = result["trust"]["auroc"]; auroc.is_number() && auroc.get<double>() < kCoin)
    remarks.push_back("predicted errors tell less than a coin which pictures are bad (AUROC " +
                      format(auroc.get<double>(), 3) + "): do not rely on them here");
  if (groups.by_group() && groups.size() < kFew)
    remarks.push_back(std::to_string(groups.size()) + (groups.size() == 1 ? " group was" : " groups were") +
                      " tested: others may be drawn much better or worse; --split group --leave-out NAME of "
                      "supertac-train tests each in turn");
  return remarks;
}

void TrustScores::add(const Drawn& drawn, const std::optional<ContactScore>& contact) {
  const std::span<const float> predicted_error = drawn.predicted_error;
  if (model_.novelty) {
    ++judged_;
    unlike_ += model_.novelty->unlike_training(signal_features(drawn.input, windows_.array())) ? 1 : 0;
  }
  if (!predicted_error.empty())
    coverage_.add(windows_.pass_of(drawn.example), drawn.pictures[0], windows_.image().width, drawn.target,
                  predicted_error, drawn.input);
  if (contact && !predicted_error.empty())
    told_.emplace_back(std::accumulate(predicted_error.begin(), predicted_error.end(), 0.0),
                       contact->ssim < kBadSsim);
}

double TrustScores::auroc() const {
  std::vector<std::pair<double, bool>> sorted = told_;
  std::ranges::sort(sorted);
  double right = 0, good = 0;  // pairs in the right order, and good pictures so far
  for (const auto& [error, bad] : sorted) bad ? right += good : good += 1;
  const double pairs = good * (static_cast<double>(sorted.size()) - good);
  return pairs > 0 ? right / pairs : std::nan("");
}

std::vector<std::pair<std::string, IntervalCoverage::Held>> TrustScores::classes() const {
  constexpr const char* kHeights[] = {"0", "to 0.2", "to 0.5", "above 0.5"};
  std::vector<std::pair<std::string, IntervalCoverage::Held>> classes;
  for (std::size_t h = 0; h < IntervalCoverage::kHeights; ++h)
    classes.emplace_back(kHeights[h], coverage_.of_height(h));
  std::erase_if(classes, [](const auto& one) { return one.second.pixels == 0; });
  return classes;
}

std::vector<std::string> TrustScores::lines() const {
  std::vector<std::string> lines;
  const auto percent = [](double share) { return format(100 * share, 1) + " %"; };
  if (!coverage_.empty())
    lines.push_back("intervals hold " + percent(coverage_.share()) + " of the pixels (interval " +
                    model_.interval().text() + "; " + coverage_.found().text() + " would hold " +
                    percent(IntervalCoverage::kCovered) + " at each height of the truth)");
  std::string truths;
  for (const auto& [name, held] : classes())
    truths += (truths.empty() ? "" : ", ") + name + " " + percent(held.share) + " (+-" +
              format(held.half_width, 2) + ")";
  if (!truths.empty()) lines.push_back("intervals hold by height of the truth: " + truths);
  if (const double told = auroc(); std::isfinite(told))
    lines.push_back("predicted errors tell an SSIM below " + format(kBadSsim) + " with an AUROC of " +
                    format(told, 3));
  if (judged_ > 0)
    lines.push_back(percent(static_cast<double>(unlike_) / static_cast<double>(judged_)) +
                    " of the windows are unlike training");
  return lines;
}

nlohmann::ordered_json TrustScores::to_json() const {
  const auto number = [](double v) { return std::isfinite(v) ? nlohmann::ordered_json(v) : nullptr; };
  nlohmann::ordered_json json;
  if (!coverage_.empty()) {
    json["interval"] = model_.interval().text();
    json["coverage"] = coverage_.share();
    json["interval_found"] = coverage_.found().text();
    for (const auto& [name, held] : classes())
      json["coverage_of"]["true " + name] = {
          {"share", number(held.share)}, {"half_width", number(held.half_width)}, {"pixels", held.pixels}};
  }
  json["auroc"] = number(auroc());
  if (judged_ > 0) json["unlike_training"] = static_cast<double>(unlike_) / static_cast<double>(judged_);
  return json;
}

}  // namespace supertac
