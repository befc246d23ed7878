#include "apps/train/training_options.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "apps/common/running/progress.h"
#include "data/recordings/signal_range.h"
#include "data/windows/random_passes.h"
#include "io/numbers/numbers.h"
#include "models/inference/interval.h"

namespace supertac {

void declare_training(Arguments& a) {
  a.option("split", "NAME",
           "what is kept for testing: window, pass, trial, texture or none; with --pairs group, pair or none "
           "(default: group, or pair for a file without groups)",
           "trial");
  a.option("epochs", "N", "passes over the training examples (default: 20; preset tiny: 80)");
  a.more();
  a.option("batch", "N", "examples per step", "64");
  a.option("learning-rate", "X",
           "peak of the rate, after warm-up and before the cosine (default: 0.001; preset tiny: 0.002)");
  a.option(
      "optimizer", "NAME",
      "adam, as in the paper; or muon: matrices of weights move by the orthogonal factor of their momentum, "
      "the rest by Adam, which learns more in as many steps, in trainings of a thousand steps and fewer with "
      "--learning-rate 0.008 (the usual one then leaves latent numbers idle)",
      "adam");
  a.option("lambda", "X", "weight of 1 - SSIM", "0.1");
  a.option("checkpoint-every", "STEPS", "how often the state is saved", "500");
  a.decides_nothing();
  a.option("ledger", "N",
           "every N steps a line that names parameters, Adam's state and batches by hashes, and twenty "
           "states on the "
           "way, for supertac-check training");
  a.decides_nothing();
  a.more(false);
}

void declare_window_training(Arguments& a) {
  a.option("plates", "A,B,...", "only recordings of these plates (default: all)");
  a.option("stride", "N", "take every N-th window of a pass", "1");
  a.option(
      "random-plates", "N",
      "also train on N simulated passes, each over a random plate (beside recordings of a real finger with a "
      "finger of its own), so that plates are felt that were never trained on",
      "0");
  a.option("leave-out", "A,B,...",
           "with --split texture: the plates that are tested (default: one drawn with the seed)");
  a.more();
  a.option(
      "rate", "HZ",
      "of the model's samples: T samples span T / HZ seconds; the paper's is 300, and the board's filter "
      "leaves nothing above 10 (default: 100; preset tiny: 50)");
  a.option(
      "range", "REST,SPAN",
      "a signal V becomes clip((REST - V) / SPAN, 0, 1), in volts or whatever the recordings hold; auto: "
      "the rig's 2.45,0.36, or where it does not fit what the recordings show",
      "auto");
  a.option("scaling", "NAME",
           "of the signals: levelled (each window to its own rest and gain, so that a finger pressed harder "
           "is seen like any other) or fixed",
           "levelled");
  a.option("augment", "NAME",
           "standard: random gains, offsets, noise, dropped taxels and a finger lifted a little, for unseen "
           "trials, and signals in which nothing is felt; none",
           "standard");
  a.option("memory", "SIZE",
           "for recordings that do not fit into memory: hold SIZE (500M, 2G) of their samples and read the "
           "others from DIR/.supertac, which is made once and takes as much disk as samples of --rate need "
           "(default: hold all)");
  a.decides_nothing();
  a.option("also", "DIR", "more recordings to train on, never tested: simulated ones, say");
  a.option("interval-factor", "X",
           "half the width of a pixel's 90 % interval in units of its spread, as supertac-evaluate finds it "
           "on passes "
           "that the network has not seen",
           format(kIntervalFactor));
  a.option("grouping", "NAME", "taxels of one VAE: horizontal (rows) or vertical (columns)", "horizontal");
  a.option("beta", "X", "weight of the KL divergence", "0.001");
  a.option("autoencoder", "NAME",
           "variational; plain: latents without noise and KL divergence, for comparison", "variational");
  a.more(false);
}

void declare_network(Arguments& a) {
  a.only_with("data");
  a.option("preset", "NAME", "network: paper, or tiny (a ninth of the multiply-adds, a third of the time)",
           "paper");
  a.option("timesteps", "T", "samples per window, a multiple of 16, 32 to 512 (default: the preset's)");
  a.option("scale", "N", "pictures N times as fine as the array, which the recordings name: 2, 4 or 8", "4");
  declare_window_training(a);
  a.more().option("latent", "LD", "latent numbers per group of taxels", "10");
}

TrainingSettings network_settings(const Arguments& a) {
  const std::string preset = a.choice("preset", {"paper", "tiny"});
  TrainingSettings s = training_settings(a, SuperTacSettings::of_preset(preset));
  if (a.given("timesteps")) s.model.timesteps = a.integer("timesteps", 32, 512);
  if (s.model.timesteps % 16 != 0) {
    throw UsageError("--timesteps expects a multiple of 16, found " + a.text("timesteps"));
  }
  s.model.latent = a.integer("latent", 1, 256);
  s.model.scale = std::stoi(a.choice("scale", {"2", "4", "8"}));
  s.seed = a.seed();
  return s;
}

void read_pace(const Arguments& a, TrainingPace& pace) {
  if (a.given("epochs")) pace.epochs = a.integer("epochs", 1, 100'000);
  if (a.given("learning-rate")) pace.learning_rate = a.number("learning-rate", 1e-9, 1);
  pace.batch = a.integer("batch", 1, 4096);
  pace.muon = a.choice("optimizer", {"adam", "muon"}) == "muon";
}

TrainingSettings training_settings(const Arguments& a, const SuperTacSettings& model) {
  const PresetTraining preset = PresetTraining::of_preset(model.preset);
  TrainingSettings s;
  s.epochs = preset.epochs;
  s.learning_rate = preset.learning_rate;
  read_pace(a, s);
  s.model = model;
  s.model.grouping = grouping_of(a.choice("grouping", {"horizontal", "vertical"}));
  s.loss.beta = a.number("beta", 0, 1e6);
  s.loss.lambda = a.number("lambda", 0, 1e6);
  if (a.choice("autoencoder", {"variational", "plain"}) == "plain") {
    if (a.given("beta")) throw UsageError("--beta: has no part in --autoencoder plain; leave it out");
    s.sampling = false;
    s.loss.beta = 0;
  }
  if (a.choice("augment", {"standard", "none"}) == "standard") s.augment = kStandardAugmentation;
  return s;
}

double training_rate_hz(const Arguments& a, const SuperTacSettings& model) {
  return a.given("rate") ? a.number("rate", 20, 2000) : PresetTraining::of_preset(model.preset).rate_hz;
}

SplitKind training_split(const Arguments& a) {
  const SplitKind split = split_kind(a.choice("split", {"window", "pass", "trial", "texture", "none"}));
  if (a.given("leave-out") && split != SplitKind::texture)
    throw UsageError("--leave-out needs --split texture, found --split " + a.text("split"));
  return split;
}

// What the option says.
static Scaling stated_range(const Arguments& a) {
  const std::vector<double> numbers = a.numbers("range", -1e6, 1e6);
  if (numbers.size() != 2 || numbers[1] <= 1e-6)
    throw UsageError("--range expects REST,SPAN with a SPAN above 0, found " + a.text("range"));
  return {.rest_volts = numbers[0], .span_volts = numbers[1]};
}

// Training on signals that are clipped draws zeros without a word.
static Scaling training_scaling(const Arguments& a, const SignalRange& range) {
  constexpr double kMostClipped = 0.5, kWorthSaying = 0.01;
  const bool automatic = a.text("range") == "auto";
  Scaling scaling = automatic ? Scaling() : stated_range(a);
  if (automatic) scaling = range.fitted();
  const std::string text = format(scaling.rest_volts) + "," + format(scaling.span_volts);
  const double clipped = range.clipped(scaling);
  if (clipped > kMostClipped)
    throw std::runtime_error("--range " + text + " clips " + format(100 * clipped, 1) +
                             " % of the signals, which lie at " + range.text() +
                             "; give REST,SPAN that hold them, or auto");
  if (clipped > kWorthSaying || scaling.rest_volts != Scaling().rest_volts)
    a.note("--range " + text + " clips " + format(100 * clipped, 1) + " % of the signals, which lie at " +
           range.text());
  scaling.levelled = a.choice("scaling", {"levelled", "fixed"}) == "levelled";
  return scaling;
}

// Random passes have the rig's volts.
static std::size_t random_plates(const Arguments& a, const Scaling& scaling) {
  const auto count = static_cast<std::size_t>(a.integer("random-plates", 0, 50'000));
  if (count > 0 && scaling.rest_volts != Scaling().rest_volts)
    throw UsageError("--random-plates imitates the rig, whose signals rest at " +
                     format(Scaling().rest_volts) + "; those of these recordings rest at " +
                     format(scaling.rest_volts));
  return count;
}

// Of the recordings that are tested; the rig's when they differ.
static double common_speed(const WindowSet& windows) {
  double speed = 0;
  for (const WindowSet::Pass& pass : windows.passes()) {
    if (pass.windows == 0 || pass.aside || pass.speed_mm_s <= 0) continue;
    if (speed > 0 && pass.speed_mm_s != speed) return rig::kSlideMmS;
    speed = pass.speed_mm_s;
  }
  return speed > 0 ? speed : rig::kSlideMmS;
}

// Who trains and tests on the simulated finger needs no other one; a real finger is not like it.
static bool all_simulated(const WindowSet& windows) {
  return std::ranges::all_of(windows.passes(),
                             [](const WindowSet::Pass& pass) { return pass.source == "simulated"; });
}

// --memory, "500M" say; nothing when all recordings are held.
static std::optional<std::uint64_t> memory_limit(const Arguments& a) {
  if (!a.given("memory")) return std::nullopt;
  std::string text = a.text("memory");
  const std::size_t unit = text.empty() ? std::string::npos : std::string("KMG").find(text.back());
  if (unit != std::string::npos) text.pop_back();
  const auto number = parse_double(text);
  if (!number || !(*number >= 0 && *number <= 1e9))
    throw UsageError("--memory expects a size such as 500M or 2G, found " + a.text("memory"));
  return static_cast<std::uint64_t>(*number * (unit == std::string::npos ? 1 : std::pow(1000, unit + 1)));
}

WindowSet training_windows(const Arguments& a, const SuperTacSettings& model, std::uint64_t seed) {
  const std::string dir = a.text("data");
  const std::vector<std::string> plates = a.list("plates");
  WindowSettings w;
  w.timesteps = static_cast<int>(model.timesteps);
  w.scale = static_cast<int>(model.scale);
  w.rate_hz = training_rate_hz(a, model);
  w.stride = static_cast<int>(a.integer("stride", 1, 100'000));
  const auto limit = memory_limit(a);
  const auto file_of = [&](const std::string& folder, const std::vector<std::string>& chosen) {
    return TrackFile::open(folder, {chosen, w.rate_hz, w.max_gap_s, *limit, reading_of(a, folder)});
  };
  const auto file = limit ? file_of(dir, plates) : nullptr;
  w.scaling = training_scaling(
      a, file ? file->index().range : SignalRange::of_folder(dir, plates, reading_of(a, dir)));
  WindowSet windows(w);
  if (file) windows.add(file);
  if (!file) windows.add_directory(dir, plates, false, reading_of(a, dir));
  windows.check_any(dir);
  if (a.given("also") && limit) windows.add(file_of(a.text("also"), {}), true);
  if (a.given("also") && !limit)
    windows.add_directory(a.text("also"), {}, true, reading_of(a, a.text("also")));
  const RandomPasses random{.count = random_plates(a, w.scaling),
                            .seed = seed,
                            .speed_mm_s = common_speed(windows),
                            .filter_s = windows.filter_s().value_or(rig::kFilterS),
                            .other_fingers = !all_simulated(windows)};
  add_random_passes(windows, random);
  if (a.text("augment") == "standard")
    add_silent_passes(windows, seed, random.count > 0 && random.other_fingers);
  return windows;
}

}  // namespace supertac
