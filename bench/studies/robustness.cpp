// How accuracy falls when the sensor gets worse or the scene is another one than in training: sensor noise,
// dead taxels, lost frames, another speed, another pitch. The network, beside the mean image and bicubic.
//
// With --data: the unseen trial of real recordings; another speed is the recording played faster or slower
// (its filter gets shorter or longer with it). Without: simulated passes, at speeds and pitches of their own.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "apps/common/version.h"
#include "data/recordings/simulator.h"
#include "data/samples/levelling.h"
#include "data/samples/split.h"
#include "data/scores/baselines.h"
#include "data/scores/metrics.h"
#include "io/file.h"
#include "io/numbers.h"
#include "io/random.h"
#include "models/evaluation.h"
#include "models/model_file.h"

namespace supertac {
namespace {

constexpr double kUsualSpeed = 10;

void declare(Arguments& a) {
  a.required("model", "FILE", "a model of supertac-train");
  a.required("out", "FILE", "CSV");
  a.option("data", "DIR", "real recordings: trial 2 is tested; without it, simulated passes are");
  a.option("plates", "A,B,...", "of the real recordings", "3_Bumps,6_Bumps,4_Ridges,6_Ridges");
  a.option("limit", "N", "windows per point, evenly spread", "600");
  a.option("seed", "N", "of the disturbances", "0");
}

// One point of one curve.
struct Condition {
  std::string name;  // noise, dead, lost, speed, pitch
  double value;
};

std::vector<Condition> conditions(bool real) {
  std::vector<Condition> all;
  const auto add = [&](const std::string& name, const std::vector<double>& values) {
    for (const double v : values) all.push_back({name, v});
  };
  add("noise", {0, 0.01, 0.02, 0.05, 0.1, 0.2});           // standard deviation, share of the sensor's range
  add("dead", {0, 1, 2, 3, 4, 5, 6, 7, 8});                // taxels that read rest
  add("lost", {0, 0.1, 0.2, 0.3, 0.4, 0.5});               // share of the frames, each repeats the one before
  add("speed", {2.5, 5, 7.5, 10, 12.5, 15, 20});           // mm/s
  if (!real) add("pitch", {3.5, 4, 5, 6, 8, 10, 12, 14});  // mm
  return all;
}

// Trial 1 for the baselines, trial 2 to be tested, at this condition's speed and pitch.
class Scene {
 public:
  Scene(const Arguments& a, const ModelFile& file) : settings_(file.windows()) {
    if (!a.given("data")) return;
    const std::vector<std::string> plates = a.list("plates");
    for (const std::string& path : list_recordings(a.text("data"))) {
      Recording recording = read_recording(path);
      if (std::find(plates.begin(), plates.end(), recording.plate) != plates.end())
        real_.push_back(std::move(recording));
    }
    if (real_.empty()) throw std::runtime_error(a.text("data") + ": no recording of the plates asked for");
  }

  WindowSet windows(int trial, const Condition& condition) const {
    WindowSet windows(settings_);
    const double speed = condition.name == "speed" ? condition.value : kUsualSpeed;
    for (const Recording& recording : real_) {
      if (recording.trial != trial) continue;
      Recording played = recording;
      for (double& t : played.time_s) t *= kUsualSpeed / speed;
      windows.add(played);
    }
    if (!real_.empty()) return windows;
    std::vector<std::string> plates = default_plates();
    if (condition.name == "pitch")
      plates = {"bumps" + format(condition.value), "ridges" + format(condition.value)};
    for (const std::string& plate : plates) {
      for (const int pass : {2, 4, 6}) {
        windows.add(simulate_pass(Plate::named(plate), {.trial = trial, .pass = pass, .speed_mm_s = speed}));
      }
    }
    return windows;
  }

 private:
  WindowSettings settings_;
  std::vector<Recording> real_;
};

// Disturbs window [T][16] number `index`; the same index is disturbed alike by every method.
void disturb(const Condition& condition, std::uint64_t seed, std::uint64_t index, std::span<float> window) {
  const RandomStream random(seed, 0x726f'6275'7374ULL ^ (index << 20));
  if (condition.name == "noise" && condition.value > 0) {
    for (std::size_t i = 0; i < window.size(); ++i) {
      window[i] = std::clamp(window[i] + static_cast<float>(condition.value * random.normal(i)), 0.0F, 1.0F);
    }
  } else if (condition.name == "dead") {
    std::array<std::size_t, kTaxels> order;
    for (std::size_t k = 0; k < kTaxels; ++k) order[k] = k;
    for (std::size_t i = 0; i < static_cast<std::size_t>(condition.value); ++i) {
      std::swap(order[i],
                order[i + static_cast<std::size_t>(random.uniform(i) * static_cast<double>(kTaxels - i))]);
      for (std::size_t at = order[i]; at < window.size(); at += kTaxels) window[at] = 0;
    }
  } else if (condition.name == "lost") {
    for (std::size_t t = 1; t < window.size() / kTaxels; ++t) {
      if (random.uniform(t) < condition.value)
        std::copy_n(&window[(t - 1) * kTaxels], kTaxels, &window[t * kTaxels]);
    }
  }
}

// Windows as a worse sensor gives them: disturbed before they are levelled.
class DisturbedWindows : public Examples {
 public:
  DisturbedWindows(const WindowSet& windows, const Condition& condition, std::uint64_t seed)
      : windows_(windows), condition_(condition), seed_(seed) {}
  std::size_t size() const override { return windows_.size(); }
  std::size_t frames() const override { return windows_.frames(); }
  TaxelArray array() const override { return windows_.array(); }
  int scale() const override { return windows_.scale(); }
  void input(std::size_t i, std::span<float> out) const override {
    std::ranges::copy(windows_.window(i), out.begin());
    disturb(condition_, seed_, i, out);
    if (windows_.settings().scaling.levelled) level(out, kTaxels);
  }
  void target(std::size_t i, std::span<float> out) const override { windows_.target(i, out); }
  std::int64_t group(std::size_t i) const override { return windows_.group(i); }
  std::string fingerprint() const override { return windows_.fingerprint(); }

 private:
  const WindowSet& windows_;
  const Condition& condition_;
  std::uint64_t seed_;
};

class Study {
 public:
  Study(const Arguments& a, const ModelFile& file)
      : model_(*file.model),
        seed_(a.seed()),
        limit_(static_cast<std::size_t>(a.integer("limit", 1, 100'000'000))),
        scene_(a, file) {
    const WindowSet train = scene_.windows(1, {"none", 0});
    const std::vector<std::uint32_t> all = all_of(train);
    baselines_.push_back(std::make_unique<MeanImage>(train, all));
    baselines_.push_back(std::make_unique<UpsampledFrame>(Upsampling::Kind::bicubic, train, all));
  }

  // Lines of the CSV: one per method.
  std::string run(const Condition& condition) const {
    const WindowSet windows = scene_.windows(2, condition);
    const DisturbedWindows disturbed(windows, condition, seed_);
    std::vector<ContactMetrics> metrics;  // network, then the baselines
    for (std::size_t i = 0; i <= baselines_.size(); ++i) metrics.emplace_back(windows.image());
    std::vector<float> picture(windows.image().pixels());
    for_each_output(model_, disturbed, spread(all_of(windows), limit_), [&](const EvaluatedBatch& b) {
      stop_if_interrupted();
      for (std::size_t n = 0; n < b.size(); ++n) {
        metrics[0].add(b.output(n), b.target(n));
        for (std::size_t k = 0; k < baselines_.size(); ++k) {
          baselines_[k]->predict(b.input(n), picture);
          metrics[k + 1].add(picture, b.target(n));
        }
      }
      return true;
    });
    std::string text;
    for (std::size_t i = 0; i < metrics.size(); ++i) {
      const Metrics m = metrics[i].contact();
      text += condition.name + "," + format(condition.value) + "," +
              (i == 0 ? "network" : baselines_[i - 1]->name()) + "," + std::to_string(m.windows) + "," +
              format(m.ssim, 4) + "," + format(m.psnr_mean_db, 3) + "," + format(m.position_error_mm, 3) +
              "\n";
    }
    return text;
  }

 private:
  static std::vector<std::uint32_t> all_of(const WindowSet& windows) {
    std::vector<std::uint32_t> all(windows.size());
    std::iota(all.begin(), all.end(), 0U);
    return all;
  }

  const SuperTac& model_;
  std::uint64_t seed_;
  std::size_t limit_;
  Scene scene_;
  Baselines baselines_;
};

int run(Arguments& a) {
  const std::string out = a.text("out");
  refuse_existing(out, a.force());
  const ModelFile file = load_model(a.text("model"));
  const Study study(a, file);
  std::string text = "# commit " + std::string(commit()) + ", " + (a.given("data") ? "real" : "simulated") +
                     " recordings, trial 2\ncondition,value,method,windows,ssim,psnr_db,position_error_mm\n";
  const std::vector<Condition> all = conditions(a.given("data"));
  Progress progress(a, "disturbing", all.size(), "points");
  for (std::size_t i = 0; i < all.size(); ++i) {
    text += study.run(all[i]);
    progress.update(i + 1);
  }
  write_file(out, text);
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const supertac::Program program{"robustness",
                                  "Accuracy against noise, dead taxels, lost frames, speed and pitch.",
                                  supertac::declare, supertac::run};
  return supertac::run_program(program, argc, argv);
}
