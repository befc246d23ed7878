// supertac-classify: which plate is under the finger? Asked of single frames, latents and super-resolved
// pictures (Figure 11 of the paper).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "apps/classify/experiment.h"
#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "data/scores/statistics.h"
#include "io/numbers/numbers.h"
#include "io/numbers/parallel.h"
#include "io/numbers/text.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("model", "FILE,...", "models by supertac-train; run i uses the i-th, and again from the first");
  a.required("data", "DIR", "recordings to train the classifiers on and to test them with");
  a.option("plates", "A,B,...", "the classes (default: the plates the first model was trained on)");
  a.option("seeds", "N", "runs: seeds 0 to N - 1 of classifier and order", "5");
  a.option("epochs", "N", "passes over the training windows", "8");
  a.option("stride", "N", "train on every N-th window in contact; tested are all", "1");
  a.option("out", "FILE",
           "keep the first run's classifier of super-resolved pictures, for supertac-stream --classifier")
      .writes();
}

namespace {

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
  explicit Tally(std::size_t classes) : classes_(classes), confusion_(classes * classes) {}
  // One answer of the current run.
  void add(std::size_t pass, std::int32_t label, std::int32_t answer) {
    ++confusion_[static_cast<std::size_t>(label) * classes_ + static_cast<std::size_t>(answer)];
    for (ClusterCount* c : {&clusters_[pass], &run_}) c->correct += label == answer ? 1 : 0, c->total += 1;
  }
  void end_run() { runs_.push_back(share({&run_, 1})), run_ = {}; }

  // Share of right answers over all runs.
  double accuracy() const { return share(clusters()); }
  // For other passes of the same plates: a bootstrap over the passes.
  Interval interval() const { return bootstrap_interval(clusters()); }
  // p-value of the difference to another tally of the same windows: sign flips over passes.
  double p_against(const Tally& other) const {
    std::vector<double> differences;
    for (const auto& [pass, count] : clusters_)
      differences.push_back(count.correct - other.clusters_.at(pass).correct);
    return sign_flip_p(differences);
  }
  nlohmann::ordered_json to_json(const std::vector<std::string>& names) const {
    const std::uint64_t all = std::accumulate(confusion_.begin(), confusion_.end(), std::uint64_t{0});
    const Interval i = interval();
    nlohmann::ordered_json json = {{"windows", all / runs_.size()},
                                   {"passes", clusters_.size()},
                                   {"accuracy", accuracy()},
                                   {"ci95_passes", {i.low, i.high}},
                                   {"accuracy_of_runs", runs_}};
    for (std::size_t row = 0; row < classes_; ++row)
      for (std::size_t c = 0; c < classes_; ++c)
        json["confusion"][names[row]][names[c]] = confusion_[row * classes_ + c];
    return json;
  }

 private:
  std::vector<ClusterCount> clusters() const {
    std::vector<ClusterCount> all;
    for (const auto& [pass, count] : clusters_) all.push_back(count);
    return all;
  }

  std::size_t classes_;
  std::vector<std::uint64_t> confusion_;          // [label][answer]
  std::map<std::size_t, ClusterCount> clusters_;  // by pass
  ClusterCount run_;
  std::vector<double> runs_;
};

using Parts = std::vector<Tally>;  // by kParts

// Every view in every run, spread over the threads.
std::vector<Parts> experiment(const Arguments& a, const std::vector<View>& views,
                              const std::vector<Candidate>& models, const WindowSet& windows,
                              const std::vector<Dataset>& data, const std::vector<std::string>& classes) {
  const auto epochs = a.integer("epochs", 1, 10'000);
  std::vector<std::vector<std::int32_t>> given(views.size() *
                                               static_cast<std::size_t>(a.integer("seeds", 1, 1000)));
  std::size_t done = 0;
  Progress progress(a, "classifying", given.size(), "classifiers");
  parallel_for(given.size(), [&](std::size_t job) {
    ExperimentSettings s{.view = views[job % views.size()], .epochs = epochs, .seed = job / views.size()};
    if (s.seed == 0 && s.view == View::super_resolved) s.keep = a.output("out");
    const std::size_t m = s.seed % models.size();
    given[job] = answers(models[m], windows, data[m], classes, s);
#pragma omp critical
    progress.update(++done);
  });
  std::vector<Parts> results(views.size(), Parts(std::size(kParts), Tally(classes.size())));
  for (std::size_t job = 0; job < given.size(); ++job) {
    const Dataset& asked = data[job / views.size() % data.size()];
    const std::vector<std::size_t> parts = parts_of(windows, asked.test);
    Parts& tallies = results[job % views.size()];
    for (std::size_t n = 0; n < asked.test.size(); ++n) {
      const std::size_t pass = windows.pass_of(asked.test[n]);
      for (std::size_t p = parts[n]; p < tallies.size(); ++p)
        tallies[p].add(pass, asked.label_of_pass[pass], given[job][n]);
    }
    for (Tally& tally : tallies) tally.end_run();
  }
  return results;
}

// A line for each view and part; views after the first also say how likely their difference to it is by
// chance.
nlohmann::ordered_json report(const Arguments& a, const std::vector<View>& views,
                              const std::vector<Parts>& results, const std::vector<std::string>& classes) {
  nlohmann::ordered_json json;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const std::string name = kViews[static_cast<int>(views[v])];
    for (std::size_t p = 0; p < std::size(kParts); ++p) {
      const Tally& tally = results[v][p];
      auto& part = json[name][kParts[p]] = tally.to_json(classes);
      const Interval i = tally.interval();
      std::string line = left_aligned(name, 16) + left_aligned(kParts[p], 9) +
                         right_aligned(format(100 * tally.accuracy(), 1), 6) + " % right, " +
                         format(100 * i.low, 1) + "-" + format(100 * i.high, 1) + " for other passes";
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
  const std::int64_t stride = a.integer("stride", 1, 100'000);
  const std::vector<Candidate> models = load_candidates(a.list("model"));
  add_model_parents(a.list("model"));
  const Candidate& first = models.front();
  std::vector<View> views{View::frame, View::latents, View::super_resolved};
  if (first.file.model->settings().timesteps == 1) views = {View::frame, View::super_resolved};
  WindowSettings taken = first.file.windows();
  taken.stride = static_cast<int>(first.recipe.stride);
  const WindowSet windows =
      WindowSet::load(a.text("data"), a.given("plates") ? a.list("plates") : first.recipe.plates, taken);
  const std::vector<std::string> classes = classes_of(windows);
  std::vector<Dataset> data;
  for (const Candidate& model : models) data.push_back(make_dataset(windows, model, classes, stride));
  const std::string split = name_of(first.recipe.split);
  a.note("split " + split + ": " + std::to_string(data.front().train.size()) + " training windows, " +
         std::to_string(data.front().test.size()) + " test windows");
  const std::vector<Parts> results = experiment(a, views, models, windows, data, classes);
  a.print(std::string("frame: the last frame of the window as the network sees it, ") +
          (taken.scaling.per_window ? "normalised to the window's own rest and gain"
                                    : "scaled by the model's fixed range") +
          ", not the raw signals");
  a.write_json({{"command", a.command_line()},
                {"commit", commit()},
                {"data", windows.fingerprint()},
                {"split", split},
                {"runs", a.integer("seeds", 1, 1000)},
                {"views", report(a, views, results, classes)}});
  return kExitOk;
}

}  // namespace supertac
