#include "apps/train/training_options.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "apps/common/running/progress.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/files/model_file.h"
#include "models/inference/interval.h"

namespace supertac {

static void declare_steps(Arguments& a) {
  a.option("split", "NAME", "what is kept for testing: window, pass, trial, texture, group or none", "trial");
  a.option("epochs", "N", "passes over the training windows (default: the preset's 20; tiny: 80)");
  a.more();
  a.option("batch", "N", "windows per step", "64");
  a.option("learning-rate", "X",
           "peak of the rate, after warm-up and before the cosine (default: the preset's 0.001; tiny, frame: "
           "0.002)");
  a.option(
      "optimizer", "NAME",
      "adam, as in the paper; or muon: matrices of weights move by the orthogonal factor of their momentum, "
      "the rest by Adam, which learns more in as many steps, in trainings of a thousand steps and fewer with "
      "--learning-rate 0.008 (the usual one then leaves latent numbers idle) (default: the preset's)");
  a.option("checkpoint-every", "STEPS", "how often the state is saved", "500");
  a.decides_nothing();
  a.option("ledger", "N",
           "every N steps a line that names parameters, Adam's state and batches by hashes, and twenty "
           "states on the way, for supertac-check training");
  a.decides_nothing();
  a.more(false);
}

static void declare_windows(Arguments& a) {
  a.option("plates", "A,B,...", "only recordings of these plates (default: all)");
  a.option("stride", "N", "take every N-th window of a pass", "1");
  a.option(
      "random-plates", "N",
      "also train on N simulated passes, each over a random plate (beside recordings of a real finger with a "
      "finger of its own), for plates that the network has not seen",
      "0");
  a.option(
      "leave-out", "A,B,...",
      "with --split texture the plates, with --split group the groups that are tested (default: drawn with "
      "the seed)");
  a.more();
  a.option(
      "rate", "HZ",
      "of the model's samples: T samples span T / HZ seconds; the paper's is 300, and the board's filter "
      "leaves nothing above 10 (default: 100; preset tiny: 50)");
  a.option("delay", "S",
           "each picture shows where the finger was so long ago, since later windows know more of a place "
           "(docs/map.md)",
           "0");
  a.option("range", "REST,SPAN",
           "a signal V becomes clip((REST - V) / SPAN, 0, 1), in the unit of the recordings; auto: "
           "the range that the recordings state, or where it does not fit what they show",
           "auto");
  a.option(
      "scaling", "NAME",
      "of the signals: per-window (each window to its own rest and gain, so that a finger pressed harder "
      "is seen like any other) or fixed",
      "per-window");
  a.option("augment", "NAME",
           "standard: random gains, offsets, noise, dropped taxels and a finger lifted a little, for unseen "
           "trials, and signals in which nothing is felt; none, as in preset frame",
           "standard");
  a.option(
      "interval-factor", "X,Y[,Z]",
      "half the width of a pixel's 90 % interval: X times the largest difference from a pixel around it, "
      "and Y times its predicted error, as supertac-evaluate finds Y on passes that the network has not "
      "seen; Z adds Z times the signal of the pixel's taxel to that error (docs/interoperate.md); one number "
      "is Y alone; split group finds Y on the tested groups",
      PixelInterval{}.text());
  a.flag(
      "last-frame",
      "give the last frame a way of its own into the picture, beside the latents: for sensors of which one "
      "frame says more than the latents keep");
  a.option("beta", "X", "weight of the KL divergence of variational autoencoders (default: 0.001)");
  a.more(false);
}

void declare_training(Arguments& a) {
  declare_steps(a);
  a.option(
      "preset", "NAME",
      "recipe to begin with: paper (as in the paper), tiny (a ninth of the multiply-adds, a third of the "
      "time) or frame (single frames as they are, without a window of time: for sensors that press or lie "
      "still)",
      "paper");
  a.option(
      "recipe-of", "MODEL",
      "begin with the recipe of this model instead: with the same recordings and no other option the same "
      "network comes out again, byte for byte");
  a.option("timesteps", "T", "samples per window, a multiple of 16, 32 to 512, or 1 (default: the preset's)");
  a.option("scale", "N", "pictures N times as fine as the array, which the recordings name: 2, 4, 8 or 16",
           "4");
  declare_windows(a);
  a.more().option("latent", "LD", "latent numbers per group of taxels", "10");
}

static std::optional<Scaling> stated_range(const Arguments& a) {
  if (a.text("range") == "auto") return std::nullopt;
  constexpr double kMost = 1e9;
  const std::string text = a.text("range");
  const std::size_t comma = std::min(text.find(','), text.size());
  const auto rest = parse_double(text.substr(0, comma));
  const auto span = parse_double(text.substr(std::min(comma + 1, text.size())));
  if (!rest || !span || !(std::abs(*rest) <= kMost) || !(std::abs(*span) > 1e-6 && std::abs(*span) <= kMost))
    throw UsageError(
        "--range expects REST,SPAN with a SPAN that is not 0 (below 0 where pressing raises the signals), "
        "found " +
        text);
  return Scaling{.rest = *rest, .span = *span};
}

Recipe recipe_of(const Arguments& a) {
  if (a.given("recipe-of") && a.given("preset"))
    throw UsageError("expected --preset NAME or --recipe-of MODEL, found both");
  Recipe r;
  if (a.given("recipe-of")) {
    r = Recipe::of(load_model(a.text("recipe-of")));
  } else {
    r = Recipe::named(a.choice("preset", {"paper", "tiny", "frame"}));
  }
  if (a.given("timesteps")) r.model.timesteps = a.integer("timesteps", 1, 512);
  if (a.given("latent")) r.model.latent = a.integer("latent", 1, 256);
  if (a.given("scale")) r.model.scale = std::stoi(a.choice("scale", {"2", "4", "8", "16"}));
  if (a.given("seed")) r.seed = a.seed();
  if (a.given("epochs")) r.epochs = a.integer("epochs", 1, 100'000);
  if (a.given("learning-rate")) r.learning_rate = a.number("learning-rate", 1e-9, 1);
  if (a.given("batch")) r.batch = a.integer("batch", 1, 4096);
  if (a.given("optimizer")) r.muon = a.choice("optimizer", {"adam", "muon"}) == "muon";
  if (a.given("split"))
    r.split = split_kind(a.choice("split", {"window", "pass", "trial", "texture", "group", "none"}));
  if (a.given("leave-out")) r.leave_out = a.list("leave-out");
  if (a.given("plates")) r.plates = a.list("plates");
  if (a.given("stride")) r.stride = a.integer("stride", 1, 100'000);
  if (a.given("random-plates")) r.random_plates = a.integer("random-plates", 0, 50'000);
  if (a.given("rate")) r.rate_hz = a.number("rate", 20, 2000);
  if (a.given("delay")) r.delay_s = a.number("delay", 0, 10);
  if (a.given("range")) r.range = stated_range(a);
  if (a.given("scaling")) r.per_window = a.choice("scaling", {"per-window", "fixed"}) == "per-window";
  if (a.given("augment"))
    r.augment =
        a.choice("augment", {"standard", "none"}) == "standard" ? kStandardAugmentation : AugmentSettings{};
  if (a.given("interval-factor")) {
    r.interval_factor = PixelInterval::read(a.text("interval-factor"));
    if (!r.interval_factor)
      throw UsageError(
          "--interval-factor: expected X,Y or X,Y,Z or Y, X from 0 to 10, Y from 0.05 to 100 and Z from 0 to "
          "4096, found " +
          in_quotes(a.text("interval-factor")));
  }
  if (a.flag("last-frame")) r.model.last_frame_path = true;
  if (a.given("beta")) r.loss.beta = a.number("beta", 0, 1e6);
  as_usage([&] { r.check(); });
  return r;
}

std::string run_folder_of(const std::string& model_file) {
  return std::filesystem::path(model_file).replace_extension(".run").string();
}

ReadingWatch reading_progress(const Arguments& a) {
  return progress_of(a, "reading " + a.text("data"), "recordings");
}

}  // namespace supertac
