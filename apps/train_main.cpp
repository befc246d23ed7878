// supertac-train: recordings in, a SuperTac model out.
#include <chrono>
#include <cmath>

#include "apps/common/numerics.h"
#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "apps/common/version.h"
#include "apps/train/run_folder.h"
#include "data/metrics.h"
#include "data/split.h"
#include "io/file.h"
#include "io/numbers.h"
#include "models/evaluation.h"
#include "models/trainer.h"

namespace supertac {
namespace {

constexpr std::int64_t kStepsPerLogLine = 50;
constexpr std::size_t kTestWindowsPerEpoch = 2000;

void declare(Arguments& a) {
  a.required("data", "DIR", "recordings to train on (supertac-simulate, -import, -collect)");
  a.required("out", "FILE",
             "the model; FILE's run folder beside it (.run) holds log, report and the state to resume");
  a.option("preset", "NAME", "network: paper", "paper");
  a.option("timesteps", "T", "samples per window at 300 Hz, a multiple of 16, 32 to 512", "256");
  a.option("latent", "LD", "latent numbers per group of taxels", "10");
  a.option("scale", "N", "pictures of 4 N pixels a side: 2, 4 or 8", "4");
  a.option("grouping", "NAME", "taxels of one VAE: horizontal (rows) or vertical (columns)", "horizontal");
  a.option("split", "NAME", "what is kept for testing: window, pass, trial, texture or none", "trial");
  a.option("epochs", "N", "passes over the training windows", "6");
  a.option("batch", "N", "windows per step", "64");
  a.option("stride", "N", "take every N-th window of a pass", "1");
  a.option("learning-rate", "X", "peak of Adam's rate, after warm-up and before the cosine", "0.001");
  a.option("augment", "NAME",
           "standard: random gains, offsets, noise and dropped taxels, for unseen trials; none", "standard");
  a.option("loss-a", "X", "share of the VAEs in the loss, 0 to 1", "0.2");
  a.option("beta", "X", "weight of the KL divergence", "0.001");
  a.option("lambda", "X", "weight of 1 - SSIM", "0.1");
  a.option("seed", "N", "of split, initial weights, order, noise", "0");
  a.option("plates", "A,B,...", "only recordings of these plates (default: all)");
  a.option("checkpoint-every", "STEPS", "how often the state is saved", "500");
  a.option("resume", "FILE", "continue from the last.safetensors of an interrupted run, same options");
}

TrainingSettings settings_of(const Arguments& a) {
  TrainingSettings s;
  s.model = SuperTacSettings::of_preset(a.choice("preset", {"paper"}));
  s.model.timesteps = a.integer("timesteps", 32, 512);
  if (s.model.timesteps % 16 != 0) {
    throw UsageError("--timesteps expects a multiple of 16, found " + a.text("timesteps"));
  }
  s.model.latent = a.integer("latent", 1, 256);
  s.model.scale = std::stoi(a.choice("scale", {"2", "4", "8"}));
  s.model.grouping = grouping_of(a.choice("grouping", {"horizontal", "vertical"}));
  s.epochs = a.integer("epochs", 1, 100'000);
  s.batch = a.integer("batch", 1, 4096);
  s.learning_rate = a.number("learning-rate", 1e-9, 1);
  s.loss = {a.number("loss-a", 0, 1), a.number("beta", 0, 1e6), a.number("lambda", 0, 1e6)};
  s.seed = static_cast<std::uint64_t>(a.integer("seed", 0, std::numeric_limits<std::int64_t>::max()));
  if (a.choice("augment", {"standard", "none"}) == "standard") {
    s.augment = {.gain = 0.5, .taxel_gain = 0.3, .offset = 0.05, .noise = 0.02, .dropped = 2};
  }
  return s;
}

WindowSet load_windows(const Arguments& a, const TrainingSettings& s) {
  WindowSettings w;
  w.timesteps = static_cast<int>(s.model.timesteps);
  w.scale = static_cast<int>(s.model.scale);
  w.stride = static_cast<int>(a.integer("stride", 1, 100'000));
  return WindowSet::load(a.text("data"), a.list("plates"), w);
}

// What the model file says of its origin; the same whatever machine, folder or number of threads.
std::map<std::string, std::string> origin(const Arguments& a, const WindowSet& windows, const Split& split) {
  return {{"split", a.text("split")},      {"seed", a.text("seed")},
          {"plates", a.text("plates")},    {"stride", a.text("stride")},
          {"data", windows.fingerprint()}, {"split_fingerprint", fingerprint(split)}};
}

// Sums of the steps since the last line of the log.
class LogMeans {
 public:
  void add(const StepReport& r) {
    ++steps_;
    total_ += r.total, reconstruction_ += r.reconstruction, kld_ += r.kld, l2_ += r.l2, ssim_ += r.ssim;
    norm_ += r.gradient_norm;
    last_ = r;
  }
  LogLine take(double seconds) {
    const double n = static_cast<double>(steps_);
    const LogLine line{seconds, last_.step, total_ / n, reconstruction_ / n, kld_ / n,
                       l2_ / n, ssim_ / n,  norm_ / n,  last_.learning_rate, {},
                       {}};
    *this = LogMeans();
    return line;
  }

 private:
  std::int64_t steps_ = 0;
  double total_ = 0, reconstruction_ = 0, kld_ = 0, l2_ = 0, ssim_ = 0, norm_ = 0;
  StepReport last_;
};

// Scores an even sample of the test windows: for the log, nothing is chosen by it.
Metrics watch(const SuperTac& model, const WindowSet& windows, const std::vector<std::uint32_t>& test) {
  std::vector<std::uint32_t> sample;
  const std::size_t step = std::max<std::size_t>(1, test.size() / kTestWindowsPerEpoch);
  for (std::size_t i = 0; i < test.size(); i += step) sample.push_back(test[i]);
  const int size = windows.image_size();
  const auto pixels = static_cast<std::size_t>(size * size);
  ContactMetrics metrics(size);
  for_each_output(model, windows, sample, [&](const EvaluatedBatch& b) {
    for (std::size_t n = 0; n < static_cast<std::size_t>(b.outputs.dim(0)); ++n) {
      metrics.add(b.outputs.values().subspan(n * pixels, pixels),
                  b.truths.values().subspan(n * pixels, pixels));
    }
    return true;
  });
  return metrics.contact();
}

class Run {
 public:
  Run(const Arguments& arguments, Trainer& trainer, RunFolder& folder, const WindowSet& windows,
      const Split& split)
      : a_(arguments),
        trainer_(trainer),
        folder_(folder),
        windows_(windows),
        split_(split),
        origin_(origin(arguments, windows, split)),
        seconds_before_(folder.seconds_before()) {}

  // Until the last step or a signal; the state is saved either way.
  void train() {
    const std::int64_t every = a_.integer("checkpoint-every", 1, 1'000'000'000);
    Progress progress(a_, "training", static_cast<std::uint64_t>(trainer_.total_steps()), "steps");
    LogMeans means;
    while (!trainer_.done() && !interrupted()) {
      const StepReport report = trainer_.train_step();
      means.add(report);
      if (report.collapsed && !warned_) {
        warned_ = true;
        a_.note("step " + std::to_string(report.step) +
                ": the pictures have collapsed to a flat image; stop and lower --learning-rate (now " +
                a_.text("learning-rate") + ")");
      }
      const bool epoch_ends = report.step % trainer_.steps_per_epoch() == 0;
      if (epoch_ends || report.step % kStepsPerLogLine == 0) log(means.take(seconds()), epoch_ends);
      if (report.step % every == 0) save();
      progress.update(static_cast<std::uint64_t>(report.step));
    }
    save();
  }

 private:
  double seconds() const {
    return seconds_before_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

  void log(LogLine line, bool epoch_ends) {
    if (epoch_ends) {
      const Metrics m = watch(trainer_.model(), windows_, split_.test);
      if (std::isfinite(m.ssim)) {
        line.test_ssim = m.ssim;
        line.test_psnr_db = m.psnr_mean_db;
      }
    }
    if (!folder_.log(line))
      a_.note(folder_.path() + "/log.csv: cannot write; the log is kept in memory only");
  }

  void save() { trainer_.save(folder_.checkpoint_path(), origin_); }

  const Arguments& a_;
  Trainer& trainer_;
  RunFolder& folder_;
  const WindowSet& windows_;
  const Split& split_;
  std::map<std::string, std::string> origin_;
  double seconds_before_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  bool warned_ = false;
};

nlohmann::ordered_json describe(const Arguments& a, const Trainer& trainer, const WindowSet& windows,
                                const Split& split) {
  return {
      {"command", a.command_line()},
      {"version", version()},
      {"commit", commit()},
      {"training", nlohmann::ordered_json::parse(trainer.settings().text())},
      {"model", nlohmann::ordered_json::parse(model_metadata(trainer.settings().model, {}).at("settings"))},
      {"parameters", trainer.model().parameter_count()},
      {"split", a.text("split")},
      {"train_windows", split.train.size()},
      {"test_windows", split.test.size()},
      {"windows", windows.counts().summary()},
      {"data", windows.fingerprint()},
      {"split_fingerprint", fingerprint(split)},
      {"steps", trainer.total_steps()}};
}

int run(Arguments& a) {
  const std::string out = a.text("out");
  const TrainingSettings settings = settings_of(a);
  const SplitKind kind = split_kind(a.choice("split", {"window", "pass", "trial", "texture", "none"}));
  refuse_existing(out, a.force());
  const WindowSet windows = load_windows(a, settings);
  const Split split = make_split(windows, kind, settings.seed);
  Trainer trainer(windows, split.train, settings);
  const bool resuming = a.given("resume");
  if (resuming) trainer.restore(a.text("resume"), origin(a, windows, split));
  RunFolder folder(out, a.force(), resuming ? std::optional(trainer.step()) : std::nullopt);
  const nlohmann::ordered_json description = describe(a, trainer, windows, split);
  folder.write_settings(description);
  a.note(windows.counts().summary());
  a.note("training on " + std::to_string(split.train.size()) + " windows, " +
         std::to_string(trainer.total_steps()) + " steps" +
         (resuming ? ", resumed at " + std::to_string(trainer.step()) : ""));
  Run(a, trainer, folder, windows, split).train();
  folder.write_report(description);
  if (!trainer.done()) {
    a.note("stopped at step " + std::to_string(trainer.step()) + " of " +
           std::to_string(trainer.total_steps()) + "; continue with the same options and --resume " +
           folder.checkpoint_path());
    return kExitFailed;
  }
  std::map<std::string, std::string> metadata = origin(a, windows, split);
  metadata["training"] = settings.text();
  save_model(out, trainer.model(),
             {windows.settings().rate_hz, windows.settings().scaling, windows.filter_s()}, metadata);
  a.print(out + ": " + std::to_string(trainer.model().parameter_count()) + " parameters after " +
          std::to_string(trainer.step()) + " steps; curves in " + folder.path() + "/report.html");
  nlohmann::ordered_json result = description;
  result["out"] = out;
  a.write_json(result);
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const supertac::Program program{"supertac-train", "Trains a tactile super-resolution model on recordings.",
                                  supertac::declare, supertac::run, supertac::numerics_text};
  return supertac::run_program(program, argc, argv);
}
