// Accuracy, coverage of the intervals and alarms against twelve ways in which a sensor or its rig gets worse,
// five severities each, in the form of ImageNet-C (Hendrycks and Dietterich 2019). No network is ever trained
// on them. One line of CSV each; severity 0 is the signal as it is.
#include <algorithm>
#include <array>
#include <cmath>

#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "data/scores/metrics.h"
#include "data/sensors/rig.h"
#include "data/windows/split.h"
#include "data/windows/transforms/normalise_window.h"
#include "data/windows/transforms/signal_features.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "io/numbers/text.h"
#include "models/files/model_file.h"
#include "models/inference/evaluation.h"
#include "models/inference/interval.h"

namespace supertac {
namespace {

struct Corruption {
  const char* name;
  const char* what;    ///< of severity s
  double severity[5];  ///< what s means, for people and for `apply`
  /// Changes a window [T][16] of scaled signals, before it is normalised. `draw` numbers the window.
  void (*apply)(double severity, std::uint64_t draw, std::span<float> window);
};

constexpr std::size_t kSignals = rig::kTaxels;
constexpr std::uint64_t kSeed = 0x636f7272;

RandomStream random_of(std::uint64_t draw) { return {kSeed, draw}; }
float clipped(double x) { return static_cast<float>(std::clamp(x, 0.0, 1.0)); }

// Different taxels in an order that depends on the window alone.
std::array<std::size_t, kSignals> order_of_taxels(std::uint64_t draw) {
  std::array<std::size_t, kSignals> order;
  for (std::size_t k = 0; k < kSignals; ++k) order[k] = k;
  const RandomStream random = random_of(draw);
  for (std::size_t i = 0; i + 1 < kSignals; ++i)
    std::swap(order[i],
              order[i + static_cast<std::size_t>(random.uniform(i) * static_cast<double>(kSignals - i))]);
  return order;
}

// x[t,k] <- f(x, t as a share of the window, k)
template <class F>
void each(std::span<float> window, F f) {
  const std::size_t frames = window.size() / kSignals;
  for (std::size_t t = 0; t < frames; ++t)
    for (std::size_t k = 0; k < kSignals; ++k) {
      float& x = window[t * kSignals + k];
      x = clipped(f(double{x}, static_cast<double>(t) / static_cast<double>(frames), k));
    }
}

// The window as it was at source(t), in frames; between two it is linear, before the first it stands.
template <class F>
void in_other_time(std::span<float> window, F source) {
  const std::vector<float> before(window.begin(), window.end());
  const std::size_t frames = window.size() / kSignals;
  for (std::size_t t = 0; t < frames; ++t) {
    const double at = std::clamp(source(t), 0.0, static_cast<double>(frames - 1));
    const auto from = std::min(static_cast<std::size_t>(at), frames - 2);
    const auto part = static_cast<float>(at - static_cast<double>(from));
    for (std::size_t k = 0; k < kSignals; ++k)
      window[t * kSignals + k] =
          std::lerp(before[from * kSignals + k], before[(from + 1) * kSignals + k], part);
  }
}

void noise(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  for (std::size_t i = 0; i < w.size(); ++i) w[i] = clipped(w[i] + s * random.normal(i));
}
void drift(double s, std::uint64_t draw, std::span<float> w) {
  const std::size_t taxel = order_of_taxels(draw)[0];
  each(w, [=](double x, double t, std::size_t k) { return k == taxel ? x + s * t : x; });
}
void gain(double s, std::uint64_t draw, std::span<float> w) {
  const double from = 0.25 + 0.5 * random_of(draw).uniform(99);
  each(w, [=](double x, double t, std::size_t) { return t < from ? x : x * (1 - s); });
}
void stuck(double s, std::uint64_t draw, std::span<float> w) {
  const auto order = order_of_taxels(draw);
  for (std::size_t i = 0; i < static_cast<std::size_t>(s); ++i) {
    const auto value = static_cast<float>(random_of(draw).uniform(50 + i));
    for (std::size_t at = order[i]; at < w.size(); at += kSignals) w[at] = value;
  }
}
void dead(double s, std::uint64_t draw, std::span<float> w) {
  const auto order = order_of_taxels(draw);
  for (std::size_t i = 0; i < static_cast<std::size_t>(s); ++i)
    for (std::size_t at = order[i]; at < w.size(); at += kSignals) w[at] = 0;
}
void saturated(double s, std::uint64_t, std::span<float> w) {
  for (float& x : w) x = std::min(x, static_cast<float>(s));
}
void jitter(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  in_other_time(w, [&](std::size_t t) { return static_cast<double>(t) + s * random.normal(t); });
}
void lost(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  for (std::size_t t = 1; t < w.size() / kSignals; ++t)
    if (random.uniform(t) < s) std::copy_n(&w[(t - 1) * kSignals], kSignals, &w[t * kSignals]);
}
// The finger was slower than stated: the window shows a shorter way.
void speed(double s, std::uint64_t, std::span<float> w) {
  const auto last = static_cast<double>(w.size() / kSignals - 1);
  in_other_time(w, [=](std::size_t t) { return last - (last - static_cast<double>(t)) * (1 - s); });
}
void tilt(double s, std::uint64_t, std::span<float> w) {
  constexpr double kMiddle = (rig::kTaxelRows - 1) / 2.0;
  each(w, [=](double x, double, std::size_t k) {
    return x * (1 + s * (static_cast<double>(k / rig::kTaxelColumns) - kMiddle) / kMiddle);
  });
}
// So many pairs of rows have their cables exchanged.
void swapped(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  std::array<std::size_t, kSignals> from;
  for (std::size_t k = 0; k < kSignals; ++k) from[k] = k;
  for (std::size_t i = 0; i < static_cast<std::size_t>(s); ++i) {
    const auto row = static_cast<std::size_t>(random.uniform(i) * (rig::kTaxelRows - 1));
    std::swap_ranges(&from[row * rig::kTaxelColumns], &from[(row + 1) * rig::kTaxelColumns],
                     &from[(row + 1) * rig::kTaxelColumns]);
  }
  for (std::size_t t = 0; t < w.size() / kSignals; ++t) {
    std::array<float, kSignals> frame;
    std::copy_n(&w[t * kSignals], kSignals, frame.begin());
    for (std::size_t k = 0; k < kSignals; ++k) w[t * kSignals + k] = frame[from[k]];
  }
}
// A pad that keeps a share s of its dent for a second (at 100 frames a second), and lets go later than it
// gives way.
void creep(double s, std::uint64_t, std::span<float> w) {
  constexpr double kDecay = 0.99;
  std::array<double, kSignals> dent{};
  each(w, [&](double x, double, std::size_t k) {
    dent[k] = std::max(x, kDecay * dent[k]);
    return (1 - s) * x + s * dent[k];
  });
}

const std::vector<Corruption>& corruptions() {
  static const std::vector<Corruption> kAll = {
      {"noise", "standard deviation, share of the range", {0.01, 0.02, 0.04, 0.08, 0.16}, noise},
      {"drift", "of one taxel within the window, share of the range", {0.02, 0.05, 0.1, 0.2, 0.4}, drift},
      {"gain", "lost in mid-pass, share", {0.05, 0.1, 0.2, 0.3, 0.5}, gain},
      {"stuck", "taxels that show one value", {1, 2, 3, 4, 6}, stuck},
      {"dead", "taxels that show rest", {1, 2, 3, 4, 6}, dead},
      {"saturated", "at this share of the range", {0.8, 0.6, 0.4, 0.3, 0.2}, saturated},
      {"jitter", "of a sample's time, samples", {0.5, 1, 2, 4, 8}, jitter},
      {"lost", "frames, share; each repeats the last", {0.1, 0.2, 0.3, 0.5, 0.7}, lost},
      {"speed", "slower than stated, share", {0.02, 0.05, 0.1, 0.2, 0.3}, speed},
      {"tilt", "outer rows' gain, share", {0.1, 0.2, 0.3, 0.5, 0.7}, tilt},
      {"swapped", "neighbouring rows exchanged, times", {1, 2, 3, 4, 5}, swapped},
      {"creep", "of the dent that stays, share", {0.05, 0.1, 0.2, 0.3, 0.5}, creep}};
  return kAll;
}

void declare(Arguments& a) {
  a.required("model", "FILE,...", "models of supertac-train; of several the pictures are averaged");
  a.required("data", "DIR", "real recordings: the split's test side is corrupted");
  a.required("out", "FILE", "CSV");
  a.option("name", "TEXT", "of the model in the CSV", "paper");
  a.option("plates", "A,B,...", "of the recordings", "3_Bumps,6_Bumps,4_Ridges,6_Ridges");
  a.option("limit", "N", "windows a point, evenly spread", "1000");
}

/// Windows as a worse sensor gives them: corrupted before they are normalised.
class CorruptedWindows : public WindowSet {
 public:
  CorruptedWindows(const WindowSet& windows, const Corruption* corruption, double severity)
      : WindowSet(windows), corruption_(corruption), severity_(severity) {}
  void window(std::size_t i, std::span<float> out) const override {
    std::ranges::copy(WindowSet::window(i), out.begin());
    if (corruption_ != nullptr) corruption_->apply(severity_, i, out);
    if (settings().scaling.per_window) normalise_window(out, kTaxels);
  }

 private:
  const Corruption* corruption_;
  double severity_;
};

struct Point {
  explicit Point(const ImageGrid& grid) : metrics(grid) {}
  ZoneMetrics metrics;
  std::uint64_t pixels = 0, covered = 0, windows = 0, alarms = 0;
  std::vector<double> distances;  // of the novelty
};

/// The chance that a corrupted window lies farther out than one as it is (area under the ROC curve).
double auroc(std::vector<double> usual, std::vector<double> odd) {
  std::ranges::sort(usual);
  double below = 0;
  for (const double d : odd) below += static_cast<double>(std::ranges::lower_bound(usual, d) - usual.begin());
  return below / (static_cast<double>(usual.size()) * static_cast<double>(odd.size()));
}

Point measure(const std::vector<ModelFile>& files, const WindowSet& windows,
              std::span<const std::uint32_t> chosen) {
  const Ensemble network = ensemble_of(files);
  const ModelFile& file = files.front();
  Point point(windows.image());
  for_each_output(network, windows, chosen, [&](const EvaluatedBatch& b) {
    stop_if_interrupted();
    for (std::size_t n = 0; n < b.size(); ++n) {
      const auto output = b.output(n), target = b.target(n), predicted_error = b.predicted_error(n);
      point.metrics.add(output, target, windows.zone(chosen[b.first + n]));
      for (std::size_t i = 0; i < predicted_error.size(); ++i)
        point.covered +=
            std::abs(output[i] - target[i]) <= file.interval_factor() * double{at_least(predicted_error[i])};
      point.pixels += predicted_error.size();
      ++point.windows;
      if (!file.novelty) continue;
      const std::vector<float> features = signal_features(b.input(n), windows.array());
      point.distances.push_back(file.novelty->distance(features));
      point.alarms += file.novelty->unlike_training(features) ? 1 : 0;
    }
    return true;
  });
  return point;
}

// `source`: command and commit, empty where they are those of the line above.
std::string line(const std::string& begin, const Point& point, const Point& usual,
                 const std::string& source = ",") {
  const auto share = [](std::uint64_t part, std::uint64_t of) {
    return of == 0 ? std::string() : format(static_cast<double>(part) / static_cast<double>(of), 4);
  };
  const Metrics contact = point.metrics.contact();
  return begin + "," + format(contact.ssim, 4) + "," + format(contact.psnr_mean_db, 2) + "," +
         format(point.metrics.flat().ghost_rate, 4) + "," + share(point.covered, point.pixels) + "," +
         share(point.alarms, point.windows) + "," +
         (usual.distances.empty() ? "" : format(auroc(usual.distances, point.distances), 4)) + "," + source +
         "\n";
}

int run(Arguments& a) {
  const std::string out = a.text("out");
  refuse_existing(out, a.force());
  const std::vector<ModelFile> files = load_models(a.list("model"));
  const ModelFile& file = files.front();
  const WindowSet windows = WindowSet::load(a.text("data"), a.list("plates"), file.windows());
  const Split split = make_split(windows, split_kind(value_or(file.metadata, "split", "none")),
                                 parse_uint(value_or(file.metadata, "seed", "0")).value_or(0),
                                 comma_list(value_or(file.metadata, "leave_out")));
  const auto chosen = evenly_spaced(split.test, static_cast<std::size_t>(a.integer("limit", 1, 100'000'000)));
  const Point usual = measure(files, CorruptedWindows(windows, nullptr, 0), chosen);
  const std::string name = a.text("name");
  std::string text =
      "model,corruption,severity,value,ssim,psnr_db,ghost_rate,coverage,alarms,alarm_auroc,command,commit\n" +
      line(name + ",none,0,0", usual, usual, "\"" + a.command_line() + "\"," + std::string(commit()));
  Progress progress(a, "corrupting", corruptions().size() * 5, "points");
  std::size_t done = 0;
  for (const Corruption& c : corruptions())
    for (int s = 0; s < 5; ++s) {
      const Point point = measure(files, CorruptedWindows(windows, &c, c.severity[s]), chosen);
      text +=
          line(name + "," + c.name + "," + std::to_string(s + 1) + "," + format(c.severity[s]), point, usual);
      progress.update(++done);
    }
  write_file(out, text);
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const supertac::Program program{"corruptions", "Accuracy, intervals and alarms against twelve corruptions.",
                                  supertac::declare, supertac::run};
  return supertac::run_program(program, argc, argv);
}
