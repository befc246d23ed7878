#include "apps/evaluate/scoring.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>

#include "data/plates/truth.h"
#include "data/scores/statistics.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/novelty.h"

namespace supertac {
namespace {

bool is_drawn(const std::string& split) { return split != "trial" && split != "none"; }

// "trial", "pass (seed 3)", "texture (leaving out 6_Bumps)": a split and what decides which windows it tests.
std::string described(const std::string& split, const std::string& left_out, const std::string& seed) {
  if (!is_drawn(split)) return split;
  return split + (left_out.empty() ? " (seed " + seed + ")" : " (leaving out " + left_out + ")");
}
std::string described(const ModelFile& file) {
  return described(value_or(file.metadata, "split", "none"), value_or(file.metadata, "leave_out"),
                   value_or(file.metadata, "seed", "0"));
}

// A split that is not drawn tests the same windows whatever was drawn for the trainings.
void refuse_leak(const std::vector<ModelFile>& files, const std::string& tested_split) {
  const auto kept_away = [&](const ModelFile& file) {
    return is_drawn(tested_split) ? described(file) : value_or(file.metadata, "split", "none");
  };
  for (const ModelFile& file : files)
    if (const std::string one = kept_away(files.front()), other = kept_away(file); other != one)
      throw std::runtime_error(
          "one model was trained with split " + one + ", another with " + other +
          ": what one is tested on the other may have seen; average models of one split");
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
  const std::string own = value_or(file.metadata, "split", "none");
  const std::string split =
      a.given("split") ? a.choice("split", {"window", "pass", "trial", "texture", "group", "none"}) : own;
  return {split,
          a.given("seed") ? a.seed() : parse_uint(value_or(file.metadata, "seed", "0")).value_or(0),
          split == own ? comma_list(value_or(file.metadata, "leave_out")) : std::vector<std::string>{},
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
  const std::string own = described(files.front()),
                    here =
                        described(tested.split_name, joined(tested.leave_out), std::to_string(tested.seed));
  if (own != "none" && tested.split_name != "none" && here != own)
    a.note(
        "the model was trained with split " + own + ", tested is split " + here +
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
  PassSums passes;
  for (const ContactScore& one : scores) passes[windows.pass_of(one.window)].add(one);
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

const std::string& group_of(const WindowSet::Pass& pass) {
  return pass.group.empty() ? pass.plate : pass.group;
}
bool has_groups(const WindowSet& windows) {
  return std::ranges::any_of(windows.passes(), [](const auto& pass) { return !pass.group.empty(); });
}

nlohmann::ordered_json scores_by_group(const std::map<std::string, ZoneMetrics>& groups) {
  nlohmann::ordered_json::array_t rows;
  for (const auto& [name, metrics] : groups)
    rows.push_back(
        {{"name", name}, {"contact", to_json(metrics.contact())}, {"all", to_json(metrics.all())}});
  std::ranges::stable_sort(rows, {}, [](const auto& row) {
    const auto& ssim = row["contact"]["ssim"];
    return ssim.is_number() ? ssim.template get<double>() : 2;
  });
  return rows;
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

nlohmann::ordered_json TrustScores::to_json() const {
  nlohmann::ordered_json json;  // a NaN is written as null
  if (!coverage_.empty()) {
    json["interval"] = model_.interval().text();
    json["coverage"] = coverage_.share();
    json["interval_found"] = coverage_.found().text();
    constexpr const char* kHeights[] = {"true 0", "true to 0.2", "true to 0.5", "true above 0.5"};
    for (std::size_t h = 0; h < IntervalCoverage::kHeights; ++h)
      if (const IntervalCoverage::Held held = coverage_.of_height(h); held.pixels > 0)
        json["coverage_of"][kHeights[h]] = {
            {"share", held.share}, {"half_width", held.half_width}, {"pixels", held.pixels}};
  }
  json["auroc"] = auroc();
  if (judged_ > 0) json["unlike_training"] = static_cast<double>(unlike_) / static_cast<double>(judged_);
  return json;
}

MapScores::MapScores(const WindowSet& windows, const ModelFile& model, std::vector<Plate> kinds)
    : windows_(windows),
      model_(model),
      stated_(!kinds.empty()),
      kinds_(stated_ ? std::move(kinds) : kinds_of_elements(kAnyKind)),
      by_pass_(windows),
      by_surface_(windows) {}

std::string MapScores::surface_of(std::size_t pass) const {
  const WindowSet::Pass& p = windows_.passes()[pass];
  return p.plate + "_t" + std::to_string(p.trial);
}

void MapScores::add(const Drawn& drawn) {
  const auto [x, y] = windows_.position(drawn.example);
  if (!std::isfinite(x) || !std::isfinite(y) || windows_.zone(drawn.example) == Zone::air) return;
  const std::size_t pass = windows_.pass_of(drawn.example);
  const Fused fresh{SurfaceMap(windows_.image(), windows_.frames() > 1), pass};
  for (Fused* fused : {&of_pass_.try_emplace(pass, fresh).first->second,
                       &of_surface_.try_emplace(surface_of(pass), fresh).first->second})
    fused->map.add(x, y, drawn.pictures[0], drawn.predicted_error);
  added_.push_back(drawn.example);
}

void MapScores::name(Fused& fused, const std::string& name, Scored& scored) {
  NamedMap& named = fused.named;
  named = {.name = name, .cells = fused.map.cells(fused.map.felt()), .cell_mm = fused.map.grid().pixel_mm};
  model_.interval().half_widths(named.cells.values, named.cells.region.width, named.cells.errors,
                                named.cells.errors);
  const Plate& kind = recognise(named, kinds_);
  if (stated_) fused.stated = plate_of(elements(named), kind);
  if (windows_.truth_is_measured(fused.pass)) return;
  for (std::size_t c = 0; c < named.cells.values.size(); ++c) {
    const auto [x, y] = centre_of(named, c);
    named.truth.push_back(static_cast<float>(truth_value(windows_.plate(fused.pass), x, y)));
  }
  scored.elements.add(named);
}

void MapScores::score(const Fused& fused, std::uint32_t window, Scored& scored) const {
  std::vector<float> read(windows_.image().pixels()), truth(read.size());
  const auto [x, y] = windows_.position(window);
  windows_.truth(window, truth);
  stated_ ? truth_image(*fused.stated, x, y, windows_.image(), read) : fused.map.read(x, y, read);
  scored.zones.add(read, truth, windows_.zone(window));
  if (const auto one = contact_score(windows_, window, read, truth)) scored.contact.push_back(*one);
}

void MapScores::finish() {
  for (auto& [surface, fused] : of_surface_) name(fused, surface, by_surface_);
  for (auto& [pass, fused] : of_pass_)
    name(fused, surface_of(pass) + "_p" + std::to_string(windows_.passes()[pass].pass), by_pass_);
  for (const std::uint32_t window : added_) {
    const std::size_t pass = windows_.pass_of(window);
    score(of_pass_.at(pass), window, by_pass_);
    score(of_surface_.at(surface_of(pass)), window, by_surface_);
  }
}

nlohmann::ordered_json MapScores::to_json() const {
  const auto middle = [](std::vector<double> v) { return v.empty() ? NAN : median(v); };  // NaN becomes null
  nlohmann::ordered_json json;
  for (const auto& [name, scored] :
       {std::pair("of_pass", &by_pass_), std::pair("of_surface", &by_surface_)}) {
    const Metrics contact = scored->zones.contact();
    json[name] = {{"ssim", contact.ssim},
                  {"psnr_mean_db", contact.psnr_mean_db},
                  {"by_distance", scores_by_distance(windows_, scored->contact)},
                  {"over_passes", scores_by_pass(windows_, scored->contact)},
                  {"elements",
                   {{"existing", scored->elements.existing},
                    {"found", scored->elements.found},
                    {"false", scored->elements.invented},
                    {"median_mm", middle(scored->elements.distances_mm)},
                    {"pitch_error_mm", middle(scored->elements.pitch_errors_mm)}}}};
  }
  const auto row = [](const NamedMap& map, const std::vector<Element>& found) {
    return nlohmann::ordered_json{
        {"kind", map.kind}, {"kind_share", map.kind_share}, {"pitch_mm", pitch_mm(found)}};
  };
  for (const auto& [name, fused] : of_surface_) {
    const std::vector<Element> found = elements(fused.named);
    auto& surface = json["surfaces"][name] = row(fused.named, found);
    for (const Element& e : found)
      for (auto& rows = surface["elements"].emplace_back(); const auto& [key, value] : numbers_of(e))
        rows[key] = value;
  }
  for (const auto& [pass, fused] : of_pass_)
    json["passes"][fused.named.name] = row(fused.named, elements(fused.named));
  return json;
}

std::vector<NamedMap> MapScores::maps(bool passes) const {
  std::vector<NamedMap> maps;
  for (const auto& [name, fused] : of_surface_) maps.push_back(fused.named);
  for (const auto& [pass, fused] : of_pass_)
    if (passes) maps.push_back(fused.named);
  return maps;
}

}  // namespace supertac
