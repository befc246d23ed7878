// Accuracy, coverage of the intervals and alarms against twelve corruptions of five severities
// (corruption.h), on the unseen trial of real recordings: one line of CSV each. Severity 0 is the signal as
// it is.
#include <array>
#include <numeric>

#include "apps/common/command_line/program.h"
#include "apps/common/command_line/version.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "bench/studies/corruption.h"
#include "data/scores/metrics.h"
#include "data/windows/levelling.h"
#include "data/windows/signal_features.h"
#include "data/windows/split.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/evaluation.h"
#include "models/inference/interval.h"

namespace supertac {
namespace {

void declare(Arguments& a) {
  a.required("model", "FILE,...", "models of supertac-train; of several the pictures are averaged");
  a.required("data", "DIR", "real recordings: the split's test side is corrupted");
  a.required("out", "FILE", "CSV");
  a.option("name", "TEXT", "of the model in the CSV", "paper");
  a.option("plates", "A,B,...", "of the recordings", "3_Bumps,6_Bumps,4_Ridges,6_Ridges");
  a.option("limit", "N", "windows a point, evenly spread", "1000");
}

/// Windows as a worse sensor gives them: corrupted before they are levelled.
class CorruptedWindows : public Examples {
 public:
  CorruptedWindows(const WindowSet& windows, const Corruption* corruption, double severity)
      : windows_(windows), corruption_(corruption), severity_(severity) {}
  std::size_t size() const override { return windows_.size(); }
  std::size_t frames() const override { return windows_.frames(); }
  TaxelArray array() const override { return windows_.array(); }
  int scale() const override { return windows_.scale(); }
  void input(std::size_t i, std::span<float> out) const override {
    std::ranges::copy(windows_.window(i), out.begin());
    if (corruption_ != nullptr) corruption_->apply(severity_, i, out);
    if (windows_.settings().scaling.levelled) level(out, kTaxels);
  }
  void target(std::size_t i, std::span<float> out) const override { windows_.target(i, out); }
  Zone zone(std::size_t i) const override { return windows_.zone(i); }
  std::int64_t group(std::size_t i) const override { return windows_.group(i); }
  std::string fingerprint() const override { return windows_.fingerprint(); }

 private:
  const WindowSet& windows_;
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

Point measure(const std::vector<ModelFile>& files, const Examples& examples,
              std::span<const std::uint32_t> chosen) {
  const Committee network(files);
  const ModelFile& file = files.front();
  Point point(examples.image());
  for_each_output(network, examples, chosen, [&](const EvaluatedBatch& b) {
    stop_if_interrupted();
    for (std::size_t n = 0; n < b.size(); ++n) {
      const auto output = b.output(n), target = b.target(n), spread = b.spread(n);
      point.metrics.add(output, target, examples.zone(chosen[b.first + n]));
      for (std::size_t i = 0; i < spread.size(); ++i)
        point.covered +=
            std::abs(output[i] - target[i]) <= file.interval_factor() * double{at_least(spread[i])};
      point.pixels += spread.size();
      ++point.windows;
      if (!file.novelty) continue;
      const std::vector<float> features = signal_features(b.input(n), examples.array());
      point.distances.push_back(file.novelty->distance(features));
      point.alarms += file.novelty->unlike_training(features) ? 1 : 0;
    }
    return true;
  });
  return point;
}

std::string line(const std::string& begin, const Point& point, const Point& usual) {
  const auto share = [](std::uint64_t part, std::uint64_t of) {
    return of == 0 ? std::string() : format(static_cast<double>(part) / static_cast<double>(of), 4);
  };
  const Metrics contact = point.metrics.contact();
  return begin + "," + format(contact.ssim, 4) + "," + format(contact.psnr_mean_db, 2) + "," +
         format(point.metrics.flat().ghost_rate, 4) + "," + share(point.covered, point.pixels) + "," +
         share(point.alarms, point.windows) + "," +
         (usual.distances.empty() ? "" : format(auroc(usual.distances, point.distances), 4)) + "\n";
}

int run(Arguments& a) {
  const std::string out = a.text("out");
  refuse_existing(out, a.force());
  const std::vector<ModelFile> files = load_models(a.list("model"));
  const ModelFile& file = files.front();
  const WindowSet windows = WindowSet::load(a.text("data"), a.list("plates"), file.windows());
  const Split split = make_split(windows, split_kind(file.metadata_or("split", "none")),
                                 parse_uint(file.metadata_or("seed", "0")).value_or(0),
                                 comma_list(file.metadata_or("leave_out", "")));
  const auto chosen = spread(split.test, static_cast<std::size_t>(a.integer("limit", 1, 100'000'000)));
  const Point usual = measure(files, CorruptedWindows(windows, nullptr, 0), chosen);
  const std::string name = a.text("name");
  std::string text =
      "# commit " + std::string(commit()) + ", " + a.command_line() +
      "\nmodel,corruption,severity,value,ssim,psnr_db,ghost_rate,coverage,alarms,alarm_auroc\n" +
      line(name + ",none,0,0", usual, usual);
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
