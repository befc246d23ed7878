// supertac-classify: which plate is under the finger? Asked of single frames and of super-resolved pictures
// (Figure 11 of the paper), and of what lies between.
#include <algorithm>

#include "apps/classify/experiment.h"
#include "apps/classify/report.h"
#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "io/files/file.h"
#include "io/numbers/parallel.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("model", "FILE,...", "models by supertac-train; run i uses the i-th, and again from the first");
  a.required("data", "DIR", "recordings to train the classifiers on and to test them with");
  a.option("plates", "A,B,...", "the classes (default: the plates the first model was trained on)");
  a.option(
      "views", "A,B,...",
      "what the classifiers see: frame (the last one, normalised as the network sees it), bicubic, "
      "super_resolved, latents, historyN (the last N "
      "frames), truth; each is compared with the first (default: frame,super_resolved,latents,history32; of "
      "a model of single frames the first two)");
  a.option("seeds", "N", "runs: seeds 0 to N - 1 of classifier and order", "5");
  a.option("epochs", "N", "passes over the training windows", "8");
  a.option("stride", "N", "train on every N-th window in contact; tested are all", "1");
  a.option("augment", "NAME",
           "standard: the training windows' gains, offsets and noise vary as in supertac-train; none",
           "standard");
  a.option("out", "FILE",
           "keep the first run's classifier of super_resolved pictures, for supertac-stream --classifier");
}

namespace {

std::vector<View> views_of(const Arguments& a) {
  if (!a.given("views"))
    return {{ViewKind::frame}, {ViewKind::super_resolved}, {ViewKind::latents}, {ViewKind::history, 32}};
  std::vector<View> views;
  for (const std::string& name : a.list("views"))
    views.push_back(read_option("views", [&] { return View::named(name); }));
  if (views.empty()) throw UsageError("--views: expected at least one view, found none");
  return views;
}

// Every view in every run: independent jobs, spread over the threads.
// Answers of run r to view v are at [r * views + v].
using Answers = std::vector<std::vector<std::int32_t>>;

Answers all_answers(const Arguments& a, const std::vector<View>& views, const std::vector<Candidate>& models,
                    const std::vector<Exam>& exams, const WindowSet& windows,
                    const std::vector<std::string>& classes, const ExperimentSettings& same) {
  Answers results(views.size() * static_cast<std::size_t>(a.integer("seeds", 1, 1000)));
  std::size_t done = 0;
  Progress progress(a, "classifying", results.size(), "classifiers");
  parallel_for(results.size(), [&](std::size_t job) {
    ExperimentSettings settings = same;
    settings.seed = job / views.size();
    const std::size_t m = settings.seed % models.size();
    const View& view = views[job % views.size()];
    settings.keep = settings.seed == 0 && view.kind == ViewKind::super_resolved ? a.output("out") : "";
    results[job] = answers(view, *models[m].file.model, windows, exams[m], classes, settings);
#pragma omp critical
    progress.update(++done);
  });
  return results;
}

std::vector<ViewResult> count(const Answers& given, const std::vector<View>& views,
                              const std::vector<Exam>& exams, const WindowSet& windows) {
  std::vector<ViewResult> results;
  for (const View& view : views)
    results.push_back({view, std::vector<Tally>(std::size(kParts), Tally(exams.front().classes))});
  for (std::size_t job = 0; job < given.size(); ++job) {
    const Exam& exam = exams[job / views.size() % exams.size()];
    const std::vector<Part> parts = parts_of(windows, exam);
    std::vector<Tally>& tallies = results[job % views.size()].parts;
    for (std::size_t n = 0; n < exam.test.size(); ++n) {
      const std::size_t pass = windows.pass_of(exam.test[n]);
      for (auto p = static_cast<std::size_t>(parts[n]); p < tallies.size(); ++p)
        tallies[p].add(pass, exam.label_of_pass[pass], given[job][n]);
    }
    for (Tally& tally : tallies) tally.end_run();
  }
  return results;
}

}  // namespace

int run(Arguments& a) {
  std::vector<View> views = views_of(a);
  if (a.given("out")) {
    if (std::ranges::none_of(views, [](const View& v) { return v.kind == ViewKind::super_resolved; }))
      throw UsageError("--out keeps the classifier of super_resolved pictures, which is not among --views");
  }
  ExperimentSettings settings;
  settings.epochs = a.integer("epochs", 1, 10'000);
  if (a.choice("augment", {"standard", "none"}) == "standard") settings.augment = kStandardAugmentation;
  const std::int64_t stride = a.integer("stride", 1, 100'000);
  const std::vector<Candidate> models = load_candidates(a.list("model"));
  add_model_parents(a.list("model"));
  if (models.front().file.model->settings().timesteps == 1 && !a.given("views")) views.resize(2);
  const WindowSet windows = exam_windows(a.text("data"), a.list("plates"), models.front());
  const std::vector<std::string> classes = classes_of(windows);
  std::vector<Exam> exams;
  for (const Candidate& model : models) exams.push_back(make_exam(windows, model, classes, stride));
  const std::string split = name_of(models.front().recipe.split);
  a.note("split " + split + ": " + std::to_string(exams.front().train.size()) + " training windows, " +
         std::to_string(exams.front().test.size()) + " test windows");

  const Answers given = all_answers(a, views, models, exams, windows, classes, settings);
  const auto results = count(given, views, exams, windows);
  const std::string frames = windows.settings().scaling.per_window
                                 ? "normalised to the window's own rest and gain"
                                 : "scaled by the model's fixed range";
  a.print("frame: the last frame of the window as the network sees it, " + frames + ", not the raw voltages");
  for (const std::string& line : tables(results, classes)) a.print(line);
  a.write_json({{"command", a.command_line()},
                {"commit", commit()},
                {"data", windows.fingerprint()},
                {"split", split},
                {"frames", frames},
                {"runs", given.size() / views.size()},
                {"views", to_json(results, classes)}});
  return kExitOk;
}

}  // namespace supertac
