// What is tested, the one loop that draws it, and the tables of its scores.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "data/scores/baselines.h"
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
  std::vector<std::string> leave_out;  ///< of split texture, the plates tested; none = drawn with the seed
  Split split;  ///< its test side is tested, the baselines are fitted to its training side
};

/// --split and --seed, or the model's own; the split itself is left to the caller.
TestSet test_set_of(const Arguments& a, const ModelFile& file);

/// Cuts the test side to --history and --limit. Throws std::runtime_error when what one model is tested on
/// may be what another was trained on (not where --split none asks for all of them), or no example is left to
/// fit the baselines to.
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

/// Draws the test side in order, with a progress bar. Throws Interrupted after a signal.
void draw_all(const Arguments& a, const Ensemble& network, const WindowSet& windows,
              std::span<const std::uint32_t> test, const Baselines& baselines,
              const std::function<void(const Drawn&)>& use);

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
/// These intervals as "SSIM 0.81 to 0.84, PSNR 20.1 to 21.0 dB", 95 %; empty where they are not known.
std::string interval_text(const WindowSet& windows, std::span<const ContactScore> scores);

/// Of a pass; its plate where it has none.
const std::string& group_of(const WindowSet::Pass& pass);
bool has_groups(const WindowSet& windows);

/// By group_of() the passes.
class GroupScores {
 public:
  explicit GroupScores(const WindowSet& windows) : windows_(windows) {}
  void add(std::uint32_t window, std::span<const float> picture, std::span<const float> truth);
  /// A line for each group, those with the lowest contact SSIM first, eight at most; none for a single one.
  std::vector<std::string> lines() const;
  /// [{"name", "contact": {...}, "all": {...}}], in the same order.
  nlohmann::ordered_json to_json() const;
  bool by_group() const { return has_groups(windows_); }
  std::size_t size() const { return groups_.size(); }

 private:
  std::vector<std::pair<std::string, const ZoneMetrics*>> worst_first() const;

  const WindowSet& windows_;
  std::map<std::string, ZoneMetrics> groups_;
};

/// What a reader of the scores should know: `result` is the evaluation's JSON. That a network is hardly above
/// ridge regression, that predicted errors do not tell bad pictures, that few groups were tested.
std::vector<std::string> remarks_on_scores(const nlohmann::ordered_json& result, const GroupScores& groups);

/// Whether a network knows when its picture is a guess: what it says of its own pictures against what is
/// true.
class TrustScores {
 public:
  /// `model`: whose interval and novelty are judged; must outlive this, as the windows.
  TrustScores(const WindowSet& windows, const ModelFile& model)
      : windows_(windows), model_(model), coverage_(model.interval(), model.model->format()) {}
  /// Windows of a pass come in the order of time. Without a predicted error nothing is counted of it.
  void add(const Drawn& drawn, const std::optional<ContactScore>& contact);

  /// For people: nothing for a model that says nothing of its pictures.
  std::vector<std::string> lines() const;
  /// {"interval", "coverage", "interval_found", "coverage_of": {"true 0": {"share", "half_width", "pixels"},
  /// "true to 0.2", "true to 0.5", "true above 0.5"}, "auroc", "unlike_training"}
  nlohmann::ordered_json to_json() const;

 private:
  /// By how high the truth is, in words; without those that no pixel belongs to.
  std::vector<std::pair<std::string, IntervalCoverage::Held>> classes() const;
  /// How often, of a contact window with an SSIM below kBadSsim and one above, the first has the larger mean
  /// predicted error (Hanley, McNeil 1982); NaN without such a pair.
  double auroc() const;
  static constexpr double kBadSsim = 0.8;

  const WindowSet& windows_;
  const ModelFile& model_;
  IntervalCoverage coverage_;
  std::vector<std::pair<double, bool>> told_;  // of contact windows: sum of predicted errors, a bad picture
  std::uint64_t judged_ = 0, unlike_ = 0;
};

}  // namespace supertac
