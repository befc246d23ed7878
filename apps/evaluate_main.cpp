// supertac-evaluate: how good a model is on a data set, beside what does without a network.
#include <algorithm>

#include "apps/common/measure.h"
#include "apps/common/output_folder.h"
#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "apps/evaluate/exports.h"
#include "apps/evaluate/felt.h"
#include "apps/evaluate/pairs.h"
#include "data/samples/split.h"
#include "data/scores/baselines.h"
#include "data/scores/metrics.h"
#include "io/file.h"
#include "io/numbers.h"
#include "io/text.h"
#include "models/committee.h"
#include "models/evaluation.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("model", "FILE,...", "a model written by supertac-train; of several the pictures are averaged");
  a.option("data", "DIR", "recordings to test on");
  a.option("pairs", "FILE", "instead of --data: pairs to test a model trained with --pairs on");
  a.option(
      "split", "NAME",
      "window, pass, trial, texture or none; with --pairs group, pair or none (default: the model's own); "
      "its test side is scored");
  a.option("seed", "N", "of the split (default: the model's own)");
  a.option("plates", "A,B,...", "only recordings of these plates (default: the model's own)");
  a.option("limit", "N", "score at most N windows, evenly spread; 0 = all", "0");
  a.option("pictures", "DIR", "write PNG pictures: input | output | truth, and a film of each test pass");
  a.option("outputs", "FILE", "write input windows, outputs and truths as safetensors");
}

namespace {

std::string metadata_or(const ModelFile& file, const std::string& key, const std::string& otherwise) {
  const auto found = file.metadata.find(key);
  return found == file.metadata.end() ? otherwise : found->second;
}

struct Task {
  WindowSet windows;
  std::string split_name;
  std::uint64_t seed;
  std::vector<std::uint32_t> train, test;
};

Task load_task(const Arguments& a, const ModelFile& file) {
  const std::vector<std::string> plates =
      a.given("plates") ? a.list("plates") : comma_list(metadata_or(file, "plates", ""));
  const std::string name = a.given("split")
                               ? a.choice("split", {"window", "pass", "trial", "texture", "none"})
                               : metadata_or(file, "split", "none");
  const std::uint64_t seed =
      a.given("seed")
          ? static_cast<std::uint64_t>(a.integer("seed", 0, std::numeric_limits<std::int64_t>::max()))
          : parse_uint(metadata_or(file, "seed", "0")).value_or(0);
  Task task{WindowSet::load(a.text("data"), plates, file.windows()), name, seed, {}, {}};
  Split split = make_split(task.windows, split_kind(name), seed);
  task.train = std::move(split.train);
  task.test = std::move(split.test);
  const auto limit =
      static_cast<std::size_t>(a.integer("limit", 0, std::numeric_limits<std::uint32_t>::max()));
  if (limit > 0) task.test = spread(task.test, limit);
  return task;
}

// What one model is tested on must not be what another was trained on. Splits of windows and passes depend
// on the seed.
void refuse_leak(const std::vector<ModelFile>& files, const Task& task) {
  const std::string split = metadata_or(files.front(), "split", "none");
  for (const ModelFile& file : files)
    if (const std::string other = metadata_or(file, "split", "none"); other != split)
      throw std::runtime_error(
          "one model was trained with split " + split + ", another with " + other +
          ": what one is tested on the other may have seen; average models of one split");
  const SplitKind kind = split_kind(task.split_name);
  if (kind != SplitKind::window && kind != SplitKind::pass) return;
  for (const ModelFile& file : files)
    if (metadata_or(file, "seed", "0") != metadata_or(files.front(), "seed", "0"))
      throw std::runtime_error("the models' seeds differ, and split " + task.split_name +
                               " differs with the seed: what one is tested on the others have seen; average "
                               "models of split trial or texture");
}

std::string row(const std::string& name, const ContactMetrics& metrics, const Latency& latency) {
  const Metrics c = metrics.contact(), all = metrics.all();
  const auto cell = [](double value, int decimals) {
    const std::string text = format(value, decimals);
    return std::string(text.size() < 9 ? 9 - text.size() : 0, ' ') + text;
  };
  return name + std::string(name.size() < 12 ? 12 - name.size() : 0, ' ') + cell(c.ssim, 3) +
         cell(c.psnr_mean_db, 2) + cell(c.position_error_mm, 2) + cell(all.ssim, 3) +
         cell(all.psnr_mean_db, 2) + cell(latency.median_us, 1);
}

/// The scores of the network and of every baseline over the same windows.
struct Scores {
  Scores(const WindowSet& windows, std::size_t baselines) : network(windows.image()), felt(windows) {
    for (std::size_t k = 0; k < baselines; ++k) plain.emplace_back(windows.image());
  }
  ContactMetrics network;
  FeltScores felt;
  std::vector<ContactMetrics> plain;
};

using Baselines = std::vector<std::unique_ptr<Baseline>>;

Scores score_all(const Arguments& a, const Committee& model, const Task& task, const Baselines& baselines,
                 std::optional<OutputsFile>& outputs) {
  Scores scores(task.windows, baselines.size());
  const std::size_t pixels = task.windows.image().pixels();
  std::vector<float> image(pixels);
  Progress progress(a, "evaluating", task.test.size(), "windows");
  for_each_output(model, task.windows, task.test, [&](const EvaluatedBatch& b) {
    for (std::size_t n = 0; n < static_cast<std::size_t>(b.outputs.dim(0)); ++n) {
      const std::uint32_t i = task.test[b.first + n];
      const std::span<const float> output = b.outputs.values().subspan(n * pixels, pixels);
      const std::span<const float> truth = b.truths.values().subspan(n * pixels, pixels);
      const std::span<const float> window = task.windows.window(i);
      const std::span<const float> seen = b.windows.values().subspan(n * window.size(), window.size());
      scores.network.add(output, truth);
      scores.felt.add(i, output, truth);
      for (std::size_t k = 0; k < baselines.size(); ++k) {
        baselines[k]->predict(seen, image);
        scores.plain[k].add(image, truth);
      }
      if (outputs) outputs->add(window, output, truth);
    }
    progress.update(b.first + static_cast<std::size_t>(b.outputs.dim(0)));
    return !interrupted();
  });
  stop_if_interrupted();
  return scores;
}

nlohmann::ordered_json report(const Arguments& a, const Committee& model, const Task& task,
                              const Baselines& baselines, const Scores& scores) {
  nlohmann::ordered_json result = scores.network.to_json();
  result["felt"] = scores.felt.to_json();
  a.print("split " + task.split_name + ", seed " + std::to_string(task.seed) + ", " +
          std::to_string(scores.network.all().windows) + " windows, " +
          std::to_string(scores.network.contact().windows) + " in contact");
  a.print("            |- in contact -------------| |- all ---------| |- one -|");
  a.print("                 SSIM  PSNR dB   pos mm     SSIM  PSNR dB       us");
  const Tensor window = Tensor::full({1, task.windows.timesteps(), model.settings().signals()}, 0.5F);
  std::vector<float> image(task.windows.image().pixels());
  const Latency latency = measure_latency([&] { model.infer(window); });
  a.print(row("network", scores.network, latency));
  nlohmann::ordered_json latencies = {{"network", latency.to_json()}};
  for (std::size_t k = 0; k < baselines.size(); ++k) {
    const std::string name = baselines[k]->name();
    const Latency l = measure_latency([&] { baselines[k]->predict(window.values(), image); });
    a.print(row(name, scores.plain[k], l));
    latencies[name] = l.to_json();
    result["baselines"][name] = scores.plain[k].to_json();
  }
  for (const std::string& line : scores.felt.lines()) a.print(line);
  result["latency"] = latencies;
  result["model"] = a.text("model");
  result["data"] = task.windows.fingerprint();
  result["split"] = task.split_name;
  result["seed"] = task.seed;
  return result;
}

}  // namespace

int run(Arguments& a) {
  if (a.given("pairs")) return evaluate_on_pairs(a);
  if (!a.given("data")) throw UsageError("expected --data DIR or --pairs FILE, found neither");
  const std::string outputs_path = a.text("outputs");
  if (!outputs_path.empty()) refuse_existing(outputs_path, a.force());
  const std::vector<ModelFile> files = load_models(a.list("model"));
  const Committee network(files);
  const Task task = load_task(a, files.front());
  refuse_leak(files, task);

  std::optional<OutputFolder> pictures;
  if (a.given("pictures")) pictures.emplace(a.text("pictures"), a.force());
  std::optional<OutputsFile> outputs;
  if (!outputs_path.empty()) outputs.emplace(task.windows, task.test.size());
  if (task.train.empty()) throw std::runtime_error("the split leaves no window to fit the baselines on");
  const Baselines baselines = fit_baselines(task.windows, task.train);
  const Scores scores = score_all(a, network, task, baselines, outputs);
  const nlohmann::ordered_json result = report(a, network, task, baselines, scores);
  if (pictures) {
    write_pictures(network, task.windows, task.test, *pictures);
    pictures->keep();
  }
  if (outputs) outputs->write(outputs_path);
  a.write_json(result);
  return kExitOk;
}

}  // namespace supertac
