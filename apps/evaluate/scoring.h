// What is tested, and the tables of its scores and of the maps of the surfaces that were felt.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "data/map/named_map.h"
#include "data/scores/metrics.h"
#include "data/windows/split.h"
#include "data/windows/windows.h"
#include "models/files/model_file.h"
#include "models/inference/interval.h"

namespace supertac {

/// Which examples are tested; what the first model was trained with, unless the options say otherwise.
struct TestSet {
  std::string split_name;
  std::uint64_t seed = 0;
  std::vector<std::string> leave_out;  ///< split texture or group: what is tested; none = drawn by the seed
  Split split;  ///< its test side is tested, the baselines are fitted to its training side
};

/// --split and --seed, or the model's own; the split itself is left to the caller.
TestSet test_set_of(const Arguments& a, const ModelFile& file);

/// Cuts the test side to --history and --limit, and says what else is to be known of it. Throws UsageError
/// where --history leaves nothing; std::runtime_error when what one model is tested on may be what another
/// was trained on (not where --split none asks for all of them), or no example is left to fit the baselines
/// to.
void check_test_set(const Arguments& a, const std::vector<ModelFile>& files, const WindowSet& windows,
                    TestSet& tested);

/// One example with its pictures: that of the network first, then those of the baselines.
struct Drawn {
  std::uint32_t example;
  std::span<const float> target;
  std::vector<std::span<const float>> pictures;
  std::span<const float> predicted_error;  ///< of the network's; empty where it has none
  std::span<const float> input;            ///< as the network takes it
};

// The tables: scores by the distance slid, by pass and by group, and what a network says of its own pictures.

/// How good the picture of a window in contact is.
struct ContactScore {
  std::uint32_t window;
  double ssim, psnr_db;
  bool is_full;  ///< a quarter of the truth is texture
};
/// Empty for a window that is not in contact.
std::optional<ContactScore> contact_score(const WindowSet& windows, std::uint32_t window,
                                          std::span<const float> picture, std::span<const float> truth);

/// Mean SSIM and PSNR by the distance slid since the first of these windows of its pass; those of a pass
/// stand in the order of time. Two elements of a texture must have been felt before their distance tells a
/// wide one from a narrow one: what is scored lower before that is not known yet. [{"from_mm", "windows",
/// "ssim", "psnr_mean_db"}, ...], without the parts no window fell into.
nlohmann::ordered_json scores_by_distance(const WindowSet& windows, std::span<const ContactScore> scores);

/// Mean SSIM and PSNR by pass. Windows of one pass resemble each other, so the intervals are over passes,
/// drawn anew within each plate: they say what other passes over these plates would give, of this one
/// network; of one pass each, what other plates (or groups) would. {"ssim": [low, high], "psnr_mean_db":
/// [low, high], "passes":
/// [{"plate", "trial", "pass", "windows", "ssim", "psnr_mean_db"}, ...]}; without the intervals where fewer
/// than two passes were in contact.
nlohmann::ordered_json scores_by_pass(const WindowSet& windows, std::span<const ContactScore> scores);

/// Of a pass; its plate where it has none.
const std::string& group_of(const WindowSet::Pass& pass);
bool has_groups(const WindowSet& windows);

/// [{"name", "contact": {...}, "all": {...}}] of groups, those with the lowest contact SSIM first.
nlohmann::ordered_json scores_by_group(const std::map<std::string, ZoneMetrics>& groups);

/// Whether a network knows when its picture is a guess: what it says of its own pictures against what is
/// true.
class TrustScores {
 public:
  /// `model`: whose interval and novelty are judged; must outlive this, as the windows.
  TrustScores(const WindowSet& windows, const ModelFile& model)
      : windows_(windows), model_(model), coverage_(model.interval(), model.model->format()) {}
  /// Windows of a pass come in the order of time. Without a predicted error nothing is counted of it.
  void add(const Drawn& drawn, const std::optional<ContactScore>& contact);

  /// {"interval", "coverage", "interval_found", "coverage_of": {"true 0": {"share", "half_width", "pixels"},
  /// "true to 0.2", "true to 0.5", "true above 0.5"}, "auroc", "unlike_training"},
  /// without what a model does not say and without heights that no pixel has.
  nlohmann::ordered_json to_json() const;

  static constexpr double kBadSsim = 0.8;

 private:
  /// How often, of a contact window with an SSIM below kBadSsim and one above, the first has the larger mean
  /// predicted error (Hanley, McNeil 1982); NaN without such a pair.
  double auroc() const;

  const WindowSet& windows_;
  const ModelFile& model_;
  IntervalCoverage coverage_;
  std::vector<std::pair<double, bool>> told_;  // of contact windows: sum of predicted errors, a bad picture
  std::uint64_t judged_ = 0, unlike_ = 0;
};

/// Fuses the network's pictures (data/map/surface_map.h), once over each pass and once over all passes of a
/// plate and trial, and reads each picture back from both. Windows in the air and those whose place is not
/// known belong to no map.
class MapScores {
 public:
  /// `model`: whose intervals the maps have, without a load; both must outlive this. `kinds`: of the
  /// elements, where that is stated (kinds_of_elements()): pictures are then read back from the maps with
  /// elements of the kind among these that each resembles most. Empty: from the maps as they are.
  MapScores(const WindowSet& windows, const ModelFile& model, std::vector<Plate> kinds);
  /// Windows of a pass come in the order of time.
  void add(const Drawn& drawn);
  /// When all have come: names the maps and reads the windows back. Before the rest below.
  void finish();

  bool empty() const { return added_.empty(); }
  /// {"of_pass": {"ssim", "psnr_mean_db", "by_distance": scores_by_distance(), "over_passes":
  /// scores_by_pass(), "elements": {"existing", "found", "false", "median_mm", "pitch_error_mm"}},
  /// "of_surface": the same, "surfaces": {PLATE_tTRIAL: {"kind", "kind_share", "pitch_mm", "elements":
  /// [{"x_mm", "y_mm", ...}]}}, "passes": {PLATE_tTRIAL_pPASS: the same without "elements"}}
  nlohmann::ordered_json to_json() const;
  /// As the network has them. PLATE_tTRIAL; with passes PLATE_tTRIAL_pPASS behind them.
  std::vector<NamedMap> maps(bool passes) const;

 private:
  struct Fused {
    SurfaceMap map;
    std::size_t pass;                                          // one of those that it is made of
    NamedMap named = {.name = {}, .cells = {}, .cell_mm = 1};  // once all have come
    std::optional<Plate> stated = {};                          // its elements, where their kind is stated
  };
  struct Scored {
    explicit Scored(const WindowSet& windows) : zones(windows.image()) {}
    ZoneMetrics zones;
    std::vector<ContactScore> contact = {};
    ElementScores elements = {};
  };
  std::string surface_of(std::size_t pass) const;
  void name(Fused& fused, const std::string& name, Scored& scored);
  void score(const Fused& fused, std::uint32_t window, Scored& scored) const;

  const WindowSet& windows_;
  const ModelFile& model_;
  bool stated_;
  std::vector<Plate> kinds_;  // all that are known, where none is stated
  std::map<std::size_t, Fused> of_pass_;
  std::map<std::string, Fused> of_surface_;
  std::vector<std::uint32_t> added_;
  Scored by_pass_, by_surface_;
};

}  // namespace supertac
