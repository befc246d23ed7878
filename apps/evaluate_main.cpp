// supertac-evaluate: how good a model is on recordings, beside what does without a network.
#include <optional>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/evaluate/exports.h"
#include "apps/evaluate/scoring.h"
#include "apps/train/training_options.h"
#include "data/recordings/recording.h"
#include "data/scores/baselines.h"
#include "data/windows/windows.h"
#include "io/files/file.h"
#include "io/numbers/clock.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/evaluation.h"

namespace supertac {
namespace {

constexpr int kSsimWindow = 7;  // pixels, of pictures below 11

using Json = nlohmann::ordered_json;

// Processor time of calls that make one picture each (batch 1, one thread), warm: what a clock on the wall
// shows on an idle machine, without the turns that other programs take on a busy one.
Json measure_latency(const std::function<void()>& make_picture) {
  constexpr int kWarmUp = 50, kPictures = 1000;
  for (int n = 0; n < kWarmUp; ++n) make_picture();
  std::vector<double> seconds(kPictures);
  for (double& s : seconds) {
    const double begin = seconds_of(CLOCK_THREAD_CPUTIME_ID);
    make_picture();
    s = seconds_of(CLOCK_THREAD_CPUTIME_ID) - begin;
  }
  return {{"median_us", 1e6 * median(seconds)}, {"p99_us", 1e6 * quantile(seconds, 0.99)}};
}

// What is tested, and by which models, is noted for all that is written.
WindowSet load_windows(const Arguments& a, const ModelFile& file) {
  const std::vector<std::string> plates =
      a.given("plates") ? a.list("plates") : comma_list(value_or(file.metadata, "plates"));
  add_model_parents(a.list("model"));
  add_parent("recordings", hash_of_recordings(a.text("data"), plates));
  return WindowSet::load(a.text("data"), plates, file.windows(), reading_progress(a));
}

/// The scores of the network and of every baseline over the same windows.
struct TestScores {
  TestScores(const WindowSet& windows, const ModelFile& model, const std::vector<Plate>& kinds,
             std::size_t methods)
      : trust(windows, model), map(windows, model, kinds) {
    for (std::size_t m = 0; m < methods; ++m) of_method.emplace_back(windows.image());
  }
  std::vector<ZoneMetrics> of_method;
  std::vector<ContactScore> contact;
  std::map<std::string, ZoneMetrics> by_group;
  TrustScores trust;
  MapScores map;
};

void score(const Drawn& d, const WindowSet& windows, TestScores& scores) {
  const Zone zone = windows.zone(d.example);
  const auto level = windows.contact_level();
  for (std::size_t m = 0; m < d.pictures.size(); ++m)
    scores.of_method[m].add(d.pictures[m], d.target, zone, level);
  scores.by_group.try_emplace(group_of(windows.passes()[windows.pass_of(d.example)]), windows.image())
      .first->second.add(d.pictures[0], d.target, zone, level);
  scores.map.add(d);
  const auto one = contact_score(windows, d.example, d.pictures[0], d.target);
  scores.trust.add(d, one);
  if (one) scores.contact.push_back(*one);
}

/// Draws the test side in order, with a progress bar. Throws Interrupted after a signal.
TestScores score_all(const Arguments& a, const Ensemble& network, const ModelFile& file,
                     const WindowSet& windows, const TestSet& tested, const Baselines& baselines,
                     const std::vector<Plate>& kinds, OutputsFile* outputs) {
  const std::vector<std::uint32_t>& test = tested.split.test;
  TestScores scores(windows, file, kinds, 1 + baselines.size());
  std::vector<std::vector<float>> plain(baselines.size(), std::vector<float>(windows.image().pixels()));
  const auto progress = progress_of(a, "evaluating", "pictures");
  for_each_output(network, windows, test, [&](const EvaluatedBatch& b) {
    progress(b.first, test.size());
    for (std::size_t n = 0; n < b.size(); ++n) {
      Drawn drawn{test[b.first + n], b.target(n), {b.output(n)}, b.predicted_error(n), b.input(n)};
      for (std::size_t k = 0; k < baselines.size(); ++k) {
        baselines[k].predict(b.input(n), plain[k]);
        drawn.pictures.push_back(plain[k]);
      }
      score(drawn, windows, scores);
      if (outputs != nullptr) outputs->add(drawn);
    }
    return true;
  });
  scores.map.finish();
  return scores;
}

Json result_of(const Arguments& a, const Ensemble& network, const WindowSet& windows, const TestSet& tested,
               const Baselines& baselines, const TestScores& scores) {
  Json result = scores.of_method.front().to_json();
  result["by_distance"] = scores_by_distance(windows, scores.contact);
  result["groups"] = scores_by_group(scores.by_group);
  result["trust"] = scores.trust.to_json();
  if (!scores.map.empty()) result["map"] = scores.map.to_json();
  const Tensor window = Tensor::full(network.first().input_shape(1), 0.5F);
  std::vector<float> image(windows.image().pixels());
  Json latencies = {{"network", measure_latency([&] { network.infer(window); })}};
  for (std::size_t k = 0; k < baselines.size(); ++k) {
    const std::string name = baselines[k].name;
    latencies[name] = measure_latency([&] { baselines[k].predict(window.values(), image); });
    result["baselines"][name] = scores.of_method[k + 1].to_json();
  }
  result["over_passes"] = scores_by_pass(windows, scores.contact);
  if (const auto level = windows.contact_level()) result["contact_level"] = *level;
  result["latency"] = latencies;
  result["model"] = a.text("model");
  result["data"] = windows.fingerprint();
  result["split"] = tested.split_name;
  result["seed"] = tested.seed;
  return result;
}

/// What the page was made with and of.
std::vector<std::pair<std::string, std::string>> made_by(const Arguments& a, const WindowSet& windows) {
  std::vector<std::pair<std::string, std::string>> lines = {{"command", a.command_line()},
                                                            {"version", version() + ", commit " + commit()}};
  const Json whole = full_provenance();
  lines.emplace_back("began", whole["began"].get<std::string>() + ", took " +
                                  format(whole["seconds"].get<double>(), 1) + " s");
  for (const auto& [name, hash] : whole["parents"].items()) lines.emplace_back(name, hash.get<std::string>());
  lines.emplace_back("windows", a.text("data") + ", hash " + windows.fingerprint());
  return lines;
}

}  // namespace

void declare(Arguments& a) {
  a.required("model", "FILE,...", "a model written by supertac-train; of several the pictures are averaged");
  a.required("data", "DIR", "recordings to test on");
  a.option("split", "NAME",
           "window, pass, trial, texture, group or none (default: the model's own); its test side is scored");
  a.option("seed", "N", "of the split (default: the model's own)");
  a.option("limit", "N", "score at most N windows, evenly spread; 0 = all", "0");
  a.option("history", "N", "score only windows with N frames of their pass behind them", "0");
  a.option("precision", "NAME", "fp32, or int8: the pictures of a microcontroller, slower", "fp32");
  a.option("outputs", "FILE",
           "write inputs as the network takes them, outputs, truths and predicted errors as safetensors")
      .writes();
  a.option(
       "map", "FILE",
       "write the surfaces that were felt, of each plate and trial: .png; .safetensors, with those of each "
       "pass beside them; .csv, their elements; or of one plate and trial .stl (docs/map.md)")
      .writes();
  a.option(
      "elements", "KIND",
      "where a map shows an element, draw one of this kind: bumps, ridges, blobs, any (the one of these that "
      "it resembles most), or an STL file of a plate with one element in its middle; maps are scored so too");
  a.option("plates", "A,B,...", "only recordings of these plates (default: the model's own)");
  a.option("pictures", "DIR",
           "write PNG pictures: input | output | truth | how far off it may be, and a film of each test pass")
      .writes();
  a.option("report", "FILE", "write one page with scores and the best and worst windows (HTML)").writes();
}

int run(Arguments& a) {
  if (a.given("map")) read_option("map", [&] { return check_map_path(a.text("map")), 0; });
  std::vector<Plate> kinds;
  if (a.given("elements"))
    kinds = read_option("elements", [&] { return kinds_of_elements(a.text("elements")); });
  const std::vector<ModelFile> files = load_models(a.list("model"));
  const Ensemble network = ensemble_of(files, precision_of(a.choice("precision", {"fp32", "int8"})));
  TestSet tested = test_set_of(a, files.front());
  const WindowSet windows = load_windows(a, files.front());
  tested.split = make_split(windows, split_kind(tested.split_name), tested.seed, tested.leave_out);
  check_test_set(a, files, windows, tested);
  for (const std::string& one : remarks_on(windows, tested.split.test)) a.note("warning: " + one);
  if (windows.filter_s() && files.front().input.filter_left(*windows.filter_s()) != 0)
    a.note("warning: the recordings' signals have gone through a moving average of " +
           format(*windows.filter_s()) + " s, those of the training through one of " +
           format(*files.front().input.filter_s) + " s: the network does not know such signals");
  if (const int side = std::min(windows.image().height, windows.image().width); side < kSsimWindow)
    a.note("pictures of " + windows.image().text() + " pixels: SSIM's window is " +
           std::to_string((side - 1) / 2 * 2 + 1) + " pixels wide instead of " + std::to_string(kSsimWindow) +
           "; compare it with others of that size only");

  std::optional<OutputFolder> pictures;
  if (a.given("pictures")) pictures.emplace(a.output("pictures"));
  OutputsFile outputs(windows);
  const Baselines baselines =
      fit_baselines(windows, tested.split.train, progress_of(a, "fitting the baselines", "parts"));
  const TestScores scores = score_all(a, network, files.front(), windows, tested, baselines, kinds,
                                      a.given("outputs") ? &outputs : nullptr);
  const Json result = result_of(a, network, windows, tested, baselines, scores);
  print_result(a, result, has_groups(windows));
  if (pictures) write_pictures(network, files.front().interval(), windows, tested.split.test, *pictures);
  if (a.given("outputs")) outputs.write(a.output("outputs"));
  if (a.given("map")) {
    std::vector<NamedMap> maps = scores.map.maps(a.text("map").ends_with(".safetensors"));
    if (!kinds.empty()) std::ranges::for_each(maps, [&](NamedMap& map) { draw_as(map, kinds); });
    write_maps(a.output("map"), maps);
  }
  if (a.given("report"))
    write_file(a.output("report"),
               evaluation_page(network, windows, scores.contact, result, made_by(a, windows)));
  if (pictures) pictures->keep();
  a.write_json(result);
  return kExitOk;
}

}  // namespace supertac
