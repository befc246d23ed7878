#include "apps/evaluate/pairs.h"

#include <algorithm>
#include <map>
#include <optional>

#include "apps/common/measure.h"
#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "data/scores/metrics.h"
#include "data/scores/pair_baselines.h"
#include "io/file.h"
#include "io/numbers.h"
#include "models/pair_trainer.h"

namespace supertac {
namespace {

/// Scores of the network and of every baseline.
struct Scores {
  explicit Scores(const PairSet& pairs)
      : methods(1 + PairBaselines::names().size(), {pairs.target_height(), pairs.target_width()}) {}
  std::vector<PairMetrics> methods;
};

std::string name_of(std::size_t method) {
  return method == 0 ? "network" : PairBaselines::names()[method - 1];
}

nlohmann::ordered_json to_json(const Scores& scores) {
  nlohmann::ordered_json json;
  for (std::size_t m = 0; m < scores.methods.size(); ++m) {
    const Metrics metrics = scores.methods[m].result();
    json["pairs"] = metrics.windows;
    json[name_of(m)] = {{"psnr_mean_db", metrics.psnr_mean_db},
                        {"psnr_pooled_db", metrics.psnr_pooled_db},
                        {"ssim", metrics.ssim}};
  }
  return json;
}

void print(const Arguments& a, const std::string& title, const Scores& scores) {
  const auto cell = [](const std::string& text, std::size_t width) {
    return std::string(text.size() < width ? width - text.size() : 0, ' ') + text;
  };
  a.print(title + ", " + std::to_string(scores.methods[0].result().windows) + " pairs:   SSIM  PSNR dB");
  for (std::size_t m = 0; m < scores.methods.size(); ++m) {
    const Metrics metrics = scores.methods[m].result();
    const std::string name = name_of(m);
    a.print("  " + name + std::string(12 - name.size(), ' ') + cell(format(metrics.ssim, 3), 9) +
            cell(format(metrics.psnr_mean_db, 2), 9));
  }
}

struct Task {
  std::string split;
  std::uint64_t seed;
  Split sides;
};

// What the model was trained with, unless the options say otherwise.
Task task_of(const Arguments& a, const FrameFile& file, const PairSet& pairs) {
  const auto of_model = [&](const char* key, const std::string& otherwise) {
    const auto found = file.metadata.find(key);
    return found == file.metadata.end() ? otherwise : found->second;
  };
  Task task;
  task.split = a.given("split") ? a.choice("split", {"group", "pair", "none"}) : of_model("split", "none");
  task.seed = a.given("seed")
                  ? static_cast<std::uint64_t>(a.integer("seed", 0, std::numeric_limits<std::int64_t>::max()))
                  : parse_uint(of_model("seed", "0")).value_or(0);
  task.sides = split_pairs(pairs, task.split, task.seed);
  const auto limit =
      static_cast<std::size_t>(a.integer("limit", 0, std::numeric_limits<std::uint32_t>::max()));
  if (limit > 0) task.sides.test = spread(task.sides.test, limit);
  return task;
}

/// Inputs, outputs and targets as the file of pairs has them.
class PairOutputs {
 public:
  void add(const PairSet& pairs, std::size_t i, std::span<const float> output,
           std::span<const float> target) {
    indices_.push_back(static_cast<std::int64_t>(i));
    groups_.push_back(pairs.group(i));
    output_.insert(output_.end(), output.begin(), output.end());
    target_.insert(target_.end(), target.begin(), target.end());
  }
  void write(const std::string& path, const PairSet& pairs) const {
    const std::uint64_t n = indices_.size(), h = pairs.target_height(), w = pairs.target_width();
    const auto bytes = [](const auto& values) { return std::as_bytes(std::span(values)); };
    write_safetensors(path, {{"format", "supertac-outputs"}},
                      {{"index", "I64", {n}, bytes(indices_)},
                       {"group", "I64", {n}, bytes(groups_)},
                       {"output", "F32", {n, 1, h, w}, bytes(output_)},
                       {"target", "F32", {n, 1, h, w}, bytes(target_)}});
  }

 private:
  std::vector<std::int64_t> indices_, groups_;
  std::vector<float> output_, target_;
};

// One frame as a network takes it.
Shape frame_shape(const PairSet& pairs) {
  return {1, static_cast<Dim>(pairs.height()), static_cast<Dim>(pairs.width()),
          static_cast<Dim>(pairs.channels())};
}

}  // namespace

int evaluate_on_pairs(const Arguments& a) {
  for (const char* name : {"data", "plates", "pictures"})
    if (a.given(name))
      throw UsageError(std::string("--") + name + ": is about recordings and has no meaning with --pairs");
  if (a.given("outputs")) refuse_existing(a.text("outputs"), a.force());
  const FrameFile file = load_frame_model(a.text("model"));
  const PairSet pairs = PairSet::read(a.text("pairs"));
  const Task task = task_of(a, file, pairs);
  const std::vector<std::uint32_t>& test = task.sides.test;

  const PairBaselines baselines(pairs, file.scaling, task.sides.train);
  Scores all(pairs), contact(pairs);
  std::map<std::int64_t, Scores> groups;
  PairOutputs outputs;
  std::vector<float> target(pairs.target_height() * pairs.target_width()), image(target.size());
  Progress progress(a, "evaluating", test.size(), "pairs");
  for_each_picture(*file.model, file.scaling, pairs, test,
                   [&](std::size_t n, std::span<const float> picture) {
                     const std::uint32_t i = test[n];
                     Scores& group = groups.try_emplace(pairs.group(i), pairs).first->second;
                     pairs.target(i, target);
                     const bool touched = std::ranges::any_of(target, [](float v) { return v > 0; });
                     for (std::size_t m = 0; m < all.methods.size(); ++m) {
                       if (m > 0) baselines.predict(m - 1, i, image);
                       const std::span<const float> drawn = m == 0 ? picture : std::span<const float>(image);
                       all.methods[m].add(drawn, target);
                       group.methods[m].add(drawn, target);
                       if (touched) contact.methods[m].add(drawn, target);
                     }
                     if (a.given("outputs")) outputs.add(pairs, i, picture, target);
                     progress.update(n + 1);
                     return !interrupted();
                   });
  stop_if_interrupted();

  print(a, "split " + task.split + ", seed " + std::to_string(task.seed), all);
  print(a, "targets that are not all 0", contact);
  const Tensor frame = Tensor::full(frame_shape(pairs), 0.5F);
  const Latency latency = measure_latency([&] { file.model->infer(frame); });
  a.print("one picture in " + format(latency.median_us, 1) + " us");
  nlohmann::ordered_json result = {
      {"contact", to_json(contact)}, {"all", to_json(all)}, {"latency", {{"network", latency.to_json()}}}};
  for (const auto& [number, scores] : groups) {
    if (!pairs.grouped()) break;
    print(a, "group " + std::to_string(number), scores);
    result["groups"][std::to_string(number)] = to_json(scores);
  }
  result["model"] = a.text("model");
  result["data"] = pairs.fingerprint();
  result["split"] = task.split;
  result["seed"] = task.seed;
  if (a.given("outputs")) outputs.write(a.text("outputs"), pairs);
  a.write_json(result);
  return kExitOk;
}

}  // namespace supertac
