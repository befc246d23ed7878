// supertac-classify: which plate is under the finger? Asked of single frames, latents and super-resolved
// pictures (Figure 11 of the paper).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/shaping.h"
#include "autograd/optimisers/adam.h"
#include "data/scores/statistics.h"
#include "data/windows/batching.h"
#include "data/windows/split.h"
#include "data/windows/windows.h"
#include "io/numbers/numbers.h"
#include "io/numbers/parallel.h"
#include "io/numbers/text.h"
#include "models/files/model_file.h"
#include "models/networks/classifier.h"
#include "models/training/recipe.h"
#include "models/training/train.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("model", "FILE,...", "models by supertac-train; run i uses the i-th, and again from the first");
  a.required("data", "DIR", "recordings to train the classifiers on and to test them with");
  a.option("plates", "A,B,...", "the classes (default: the plates the first model was trained on)");
  a.option("seeds", "N", "runs: seeds 0 to N - 1 of classifier and order", "5");
  a.option("epochs", "N", "passes over the training windows", "8");
}

namespace {

// What a classifier is shown of a window: the last frame as the network sees it, the means of the latent
// distributions, or the network's picture.
enum class View { frame, latents, super_resolved };
inline constexpr const char* kViews[] = {"frame", "latents", "super_resolved"};

// A model, what it was trained with, and the two sides of that training's split: neither it nor a classifier
// that is trained on the first has seen the second.
struct Candidate {
  std::string path;
  Recipe recipe;
  ModelFile file;
  Split split = {};
};

// Windows, and for each pass the class of its plate, by the order in which plates come.
struct Labelled {
  explicit Labelled(WindowSet all) : windows(std::move(all)) {
    std::vector<std::string> plates;
    for (const WindowSet::Pass& pass : windows.passes()) {
      const auto known = std::ranges::find(plates, pass.plate);
      label_of_pass.push_back(static_cast<std::int32_t>(known - plates.begin()));
      if (known == plates.end()) plates.push_back(pass.plate);
    }
    classes = std::ssize(plates);
    if (classes < 2)
      throw std::runtime_error("the recordings are of one plate; there is nothing to tell apart");
  }
  WindowSet windows;
  Dim classes = 0;
  std::vector<std::int32_t> label_of_pass = {};
};

constexpr std::size_t kBatch = 64;
constexpr double kLearningRate = 1e-3, kWarmUp = 0.05;

Tensor gather(const WindowSet& windows, std::span<const std::uint32_t> indices) {
  Tensor all(Shape{static_cast<Dim>(indices.size()), static_cast<Dim>(windows.frames()),
                   static_cast<Dim>(windows.array().signals())});
  const std::size_t size = windows.input_size();
  for (std::size_t n = 0; n < indices.size(); ++n)
    windows.window(indices[n], all.values().subspan(n * size, size));
  return all;
}

// Windows [N,T,signals] -> [N,height,width,channels]; latents are channels of one pixel.
Tensor show(View view, const SuperTac& model, const TaxelArray& array, const Tensor& windows) {
  if (view == View::frame)
    return last_frame(Variable(windows), array.rows, array.columns, array.channels).value();
  if (view == View::super_resolved) return model.infer(windows);
  const Tensor latents = model.encode(windows);
  return Tensor::of({latents.dim(0), 1, 1, latents.dim(1)}, latents.values());
}

// Training windows are augmented as the model's were. Throws std::runtime_error when the loss is not finite.
void train(const TextureClassifier& classifier, const Candidate& model, const Labelled& data, View view,
           std::int64_t epochs, std::uint64_t seed) {
  const WindowSet& windows = data.windows;
  const Batching batching(model.split.train, kBatch, seed);
  const auto total = static_cast<std::int64_t>(batching.batches_per_epoch()) * epochs;
  const Schedule schedule{.peak = kLearningRate,
                          .warm_up = static_cast<std::int64_t>(kWarmUp * static_cast<double>(total)),
                          .total = total};
  Adam adam(values_of(classifier.parameters()), {.learning_rate = kLearningRate, .clip_norm = 1});
  std::vector<std::uint32_t> indices(batching.batch_size());
  for (std::int64_t step = 0; step < total; ++step) {
    stop_if_interrupted();
    batching.batch(static_cast<std::uint64_t>(step), indices);
    Tensor shown = gather(windows, indices);
    const auto size = shown.values().size() / indices.size();
    for (std::size_t n = 0; model.recipe.augment.any() && n < indices.size(); ++n)
      augment(model.recipe.augment, seed, batching.sample(static_cast<std::uint64_t>(step), n),
              shown.values().subspan(n * size, size), windows.array());
    std::vector<std::int32_t> labels;
    for (const std::uint32_t i : indices) labels.push_back(data.label_of_pass[windows.pass_of(i)]);
    const Variable x(show(view, *model.file.model, windows.array(), shown));
    const Variable loss = softmax_cross_entropy(classifier.forward(x), labels);
    if (!std::isfinite(loss.item()))
      throw std::runtime_error("the classifier of " + std::string(kViews[static_cast<int>(view)]) +
                               " diverged at step " + std::to_string(step + 1));
    adam.zero_grad();
    backward(loss);
    adam.set_learning_rate(schedule.at(step));
    adam.step();
  }
}

// Throws std::runtime_error naming the file: when it cannot be read, does not say how it was trained, was
// trained on all windows, or differs from the first in more than its seeds.
std::vector<Candidate> load_candidates(const std::vector<std::string>& paths) {
  std::vector<Candidate> all;
  for (const std::string& path : paths) {
    ModelFile file = load_model(path);
    const Recipe recipe = Recipe::of(file);
    all.push_back({path, recipe, std::move(file)});
    const Candidate &first = all.front(), &last = all.back();
    if (recipe.split == SplitKind::none)
      throw std::runtime_error(path + ": was trained on all windows (split none), so none is left to test");
    for (const char* key : {"input", "settings", "split", "stride"}) {
      const std::string ours = value_or(last.file.metadata, key), theirs = value_or(first.file.metadata, key);
      if (ours != theirs)
        throw std::runtime_error(path + ": its " + key + " is " + ours + ", that of " + first.path + " is " +
                                 theirs + "; give models that differ in their seeds only");
    }
  }
  return all;
}

// Repeats the split that the model was trained with, and trains on windows in contact only. Throws
// std::runtime_error when that split cannot be repeated on these windows.
void take_split(Candidate& model, const WindowSet& windows, const std::string& folder) {
  std::vector<std::uint32_t> held_out;
  Split& split = model.split = split_of(windows, model.recipe, held_out);
  // Trials are what they are; other splits are drawn from the windows there are. A training has more windows
  // than these, in which nothing is felt.
  if (model.recipe.split != SplitKind::trial) {
    const TrainingTask task = window_task(model.recipe, folder);
    if (task.split.test != split.test ||
        task.origin.at("split_fingerprint") != value_or(model.file.metadata, "split_fingerprint"))
      throw std::runtime_error(model.path +
                               ": its split cannot be repeated on this data, and it may have seen the test "
                               "windows; give the recordings and plates it was trained on");
  }
  std::erase_if(split.train, [&](std::uint32_t i) { return !windows.contact(i); });
  if (split.train.empty()) throw std::runtime_error("no training window is in contact with its plate");
}

// Trains a classifier and returns its answer to every test window, in order. The same arguments give the same
// answers.
std::vector<std::int32_t> answers(const Candidate& model, const Labelled& data, View view,
                                  std::int64_t epochs, std::uint64_t seed) {
  const auto shown = [&](std::span<const std::uint32_t> indices) {
    return show(view, *model.file.model, data.windows.array(), gather(data.windows, indices));
  };
  const Tensor sample = shown(std::span(model.split.train).first(1));
  Rng rng(seed);
  const TextureClassifier classifier(
      {.height = sample.dim(1), .width = sample.dim(2), .channels = sample.dim(3), .classes = data.classes},
      rng);
  train(classifier, model, data, view, epochs, seed);
  const NoGrad no_grad;
  const std::span<const std::uint32_t> test(model.split.test);
  std::vector<std::int32_t> result;
  for (std::size_t first = 0; first < test.size(); first += kBatch) {
    stop_if_interrupted();
    const Variable x(shown(test.subspan(first, std::min(kBatch, test.size() - first))));
    const Tensor logits = classifier.forward(x).value();
    for (const real* row = logits.data(); row != logits.data() + logits.values().size(); row += data.classes)
      result.push_back(static_cast<std::int32_t>(std::max_element(row, row + data.classes) - row));
  }
  return result;
}

// Which test windows are counted, each with those before it. Near the ends of a texture one element is seen
// of any plate, and beyond them none: there no picture, not even a perfect one, tells plates apart.
constexpr const char* kParts[] = {"inside", "contact", "all"};

// The narrowest part of each test window: the whole picture lies on the texture; the truth has a pixel above
// 0; other. Without positions all in contact are inside.
std::vector<std::size_t> parts_of(const WindowSet& windows, const std::vector<std::uint32_t>& test) {
  std::vector<std::size_t> parts;
  for (const std::uint32_t i : test) {
    const Plate& plate = windows.plate(windows.pass_of(i));
    const double y = windows.position(i).y_mm, half = windows.image().height_mm() / 2;
    const bool contact = windows.contact(i);
    const bool inside =
        std::isnan(y) ? contact : y - half >= plate.texture_begin() && y + half <= plate.texture_end();
    parts.push_back(inside ? 0 : contact ? 1 : 2);
  }
  return parts;
}

// What the answers of all runs about one set of windows add up to.
class Tally {
 public:
  // One answer of the current run.
  void add(std::size_t pass, std::int32_t label, std::int32_t answer) {
    for (ClusterCount* c : {&clusters_[pass], &run_}) c->correct += label == answer ? 1 : 0, c->total += 1;
  }
  void end_run() { runs_.push_back(share({&run_, 1})), run_ = {}; }
  // p-value of the difference to another tally of the same windows: sign flips over passes.
  double p_against(const Tally& other) const {
    std::vector<double> differences;
    for (const auto& [pass, count] : clusters_)
      differences.push_back(count.correct - other.clusters_.at(pass).correct);
    return sign_flip_p(differences);
  }
  // Share of right answers over all runs, and, for other passes of the same plates, by a bootstrap over the
  // passes, where it lies.
  nlohmann::ordered_json to_json() const {
    std::size_t all = 0;
    std::vector<ClusterCount> clusters;
    for (const auto& [pass, count] : clusters_)
      clusters.push_back(count), all += static_cast<std::size_t>(count.total);
    const Interval i = bootstrap_interval(clusters);
    return {{"windows", all / runs_.size()},
            {"passes", clusters.size()},
            {"accuracy", share(clusters)},
            {"ci95_passes", {i.low, i.high}},
            {"accuracy_of_runs", runs_}};
  }

 private:
  std::map<std::size_t, ClusterCount> clusters_;  // by pass
  ClusterCount run_;
  std::vector<double> runs_;
};

using Parts = std::vector<Tally>;  // by kParts

// Every view in every run, spread over the threads.
std::vector<Parts> experiment(const Arguments& a, const std::vector<View>& views,
                              const std::vector<Candidate>& models, const Labelled& data) {
  const auto epochs = a.integer("epochs", 1, 10'000);
  std::vector<std::vector<std::int32_t>> given(views.size() *
                                               static_cast<std::size_t>(a.integer("seeds", 1, 1000)));
  std::size_t done = 0;
  Progress progress(a, "classifying", given.size(), "classifiers");
  const auto model_of = [&](std::size_t job) -> const Candidate& {
    return models[job / views.size() % models.size()];
  };
  parallel_for(given.size(), [&](std::size_t job) {
    given[job] = answers(model_of(job), data, views[job % views.size()], epochs, job / views.size());
#pragma omp critical
    progress.update(++done);
  });
  std::vector<Parts> results(views.size(), Parts(std::size(kParts)));
  for (std::size_t job = 0; job < given.size(); ++job) {
    const std::vector<std::uint32_t>& test = model_of(job).split.test;
    const std::vector<std::size_t> parts = parts_of(data.windows, test);
    Parts& tallies = results[job % views.size()];
    for (std::size_t n = 0; n < test.size(); ++n) {
      const std::size_t pass = data.windows.pass_of(test[n]);
      for (std::size_t p = parts[n]; p < tallies.size(); ++p)
        tallies[p].add(pass, data.label_of_pass[pass], given[job][n]);
    }
    for (Tally& tally : tallies) tally.end_run();
  }
  return results;
}

// A line for each view and part; views after the first also say how likely their difference to it is by
// chance.
nlohmann::ordered_json report(const Arguments& a, const std::vector<View>& views,
                              const std::vector<Parts>& results) {
  nlohmann::ordered_json json;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const std::string name = kViews[static_cast<int>(views[v])];
    for (std::size_t p = 0; p < std::size(kParts); ++p) {
      const Tally& tally = results[v][p];
      auto& part = json[name][kParts[p]] = tally.to_json();
      const auto percent = [](const auto& share) { return format(100 * share.template get<double>(), 1); };
      std::string line = left_aligned(name, 16) + left_aligned(kParts[p], 9) +
                         right_aligned(percent(part["accuracy"]), 6) + " % right, " +
                         percent(part["ci95_passes"][0]) + "-" + percent(part["ci95_passes"][1]) +
                         " for other passes";
      if (v > 0) {
        const double chance = tally.p_against(results.front()[p]);
        part["p_against_frame"] = chance;
        line += ", p " + format(chance, 4) + " against frame";
      }
      a.print(line);
    }
  }
  return json;
}

}  // namespace

int run(Arguments& a) {
  std::vector<Candidate> models = load_candidates(a.list("model"));
  add_model_parents(a.list("model"));
  const Candidate& first = models.front();
  std::vector<View> views{View::frame, View::latents, View::super_resolved};
  if (first.file.model->settings().timesteps == 1) views = {View::frame, View::super_resolved};
  WindowSettings taken = first.file.windows();
  taken.stride = static_cast<int>(first.recipe.stride);
  const Labelled data(
      WindowSet::load(a.text("data"), a.given("plates") ? a.list("plates") : first.recipe.plates, taken));
  for (Candidate& model : models) take_split(model, data.windows, a.text("data"));
  const std::string split = name_of(first.recipe.split);
  a.note("split " + split + ": " + std::to_string(first.split.train.size()) + " training windows, " +
         std::to_string(first.split.test.size()) + " test windows");
  const std::vector<Parts> results = experiment(a, views, models, data);
  a.print(std::string("frame: the last frame of the window as the network sees it, ") +
          (taken.scaling.per_window ? "normalised to the window's own rest and gain"
                                    : "scaled by the model's fixed range") +
          ", not the raw signals");
  a.write_json({{"command", a.command_line()},
                {"commit", commit()},
                {"data", data.windows.fingerprint()},
                {"split", split},
                {"runs", a.integer("seeds", 1, 1000)},
                {"views", report(a, views, results)}});
  return kExitOk;
}

}  // namespace supertac
