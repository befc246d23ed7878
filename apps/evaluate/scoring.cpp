#include "apps/evaluate/scoring.h"

#include <limits>
#include <stdexcept>

#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/evaluation.h"

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

}  // namespace supertac
