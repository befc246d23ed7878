// Ghosts where there is nothing to be felt: pictures of signals that stand, that are noise, that drift. One
// line of CSV for each kind and strength. Training shows others of their kind (add_silent_passes).
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "apps/common/command_line/program.h"
#include "apps/common/command_line/version.h"
#include "apps/common/running/signals.h"
#include "data/scores/metrics.h"
#include "data/windows/levelling.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "models/inference/evaluation.h"

namespace supertac {
namespace {

constexpr std::uint64_t kSeed = 0x73696c656e74;  // "silent"

/// Strengths are shares of the signals' range; of the rig's .36 V .003 is the noise of its board, and as much
/// is what its signals drift by within a window of 2.56 s.
struct Kind {
  const char* name;
  std::array<double, 4> strengths;
};
constexpr Kind kKinds[] = {
    {"constant", {0, 0, 0, 0}}, {"noisy", {0.003, 0.01, 0.02, 0.04}}, {"drifting", {0.003, 0.02, 0.05, 0.1}}};
// Of the range: a finger in the air, one that lies on a flat plate, one that is pressed as hard as the range
// goes.
constexpr std::array<double, 3> kPressed = {0.02, 0.3, 0.9};

/// Windows of a finger that feels the same all the time: every taxel stands at a level of its own, drawn up
/// to `pressed`, with noise of that deviation, or drifts by up to that much in either direction.
class SilentWindows : public Examples {
 public:
  SilentWindows(const WindowSettings& settings, std::size_t count, std::string_view kind, double strength,
                double pressed)
      : settings_(settings), count_(count), kind_(kind), strength_(strength), pressed_(pressed) {}
  std::size_t size() const override { return count_; }
  std::size_t frames() const override { return static_cast<std::size_t>(settings_.timesteps); }
  TaxelArray array() const override { return settings_.array.value_or(TaxelArray{}); }
  int scale() const override { return settings_.scale; }
  void input(std::size_t i, std::span<float> out) const override {
    const RandomStream random(kSeed, i);
    const std::size_t signals = array().signals();
    for (std::size_t t = 0; t < frames(); ++t)
      for (std::size_t k = 0; k < signals; ++k) {
        double x = pressed_ * random.uniform(k);
        if (kind_ == "noisy") x += strength_ * random.normal(1000 + t * signals + k);
        if (kind_ == "drifting")
          x += strength_ * (2 * random.uniform(500 + k) - 1) * static_cast<double>(t) /
               static_cast<double>(frames());
        out[t * signals + k] = static_cast<float>(std::clamp(x, 0.0, 1.0));
      }
    if (settings_.scaling.levelled) level(out, signals);
  }
  void target(std::size_t, std::span<float> out) const override { std::ranges::fill(out, 0.0F); }
  std::int64_t group(std::size_t i) const override { return static_cast<std::int64_t>(i); }
  std::string fingerprint() const override { return "0000000000000000"; }

 private:
  WindowSettings settings_;
  std::size_t count_;
  std::string kind_;
  double strength_, pressed_;
};

void declare(Arguments& a) {
  a.required("model", "FILE,...", "models of supertac-train; of several the pictures are averaged");
  a.required("out", "FILE", "CSV");
  a.option("name", "TEXT", "of the model in the CSV", "paper");
  a.option("limit", "N", "windows a line", "1000");
}

int run(Arguments& a) {
  const std::string out = a.text("out");
  refuse_existing(out, a.force());
  const std::vector<ModelFile> files = load_models(a.list("model"));
  const Committee network(files);
  std::vector<std::uint32_t> all(static_cast<std::size_t>(a.integer("limit", 1, 1'000'000)));
  std::iota(all.begin(), all.end(), 0U);
  std::string text = "# commit " + std::string(commit()) + ", " + a.command_line() +
                     "\nmodel,signals,strength,pressed,windows,ghost_rate,highest\n";
  for (const Kind& kind : kKinds)
    for (std::size_t s = 0; s < (kind.strengths[0] > 0 ? kind.strengths.size() : 1); ++s)
      for (const double pressed : kPressed) {
        const SilentWindows windows(files.front().windows(), all.size(), kind.name, kind.strengths[s],
                                    pressed);
        ZoneMetrics metrics(windows.image());
        float highest = 0;
        for_each_output(network, windows, all, [&](const EvaluatedBatch& b) {
          stop_if_interrupted();
          for (std::size_t n = 0; n < b.size(); ++n) {
            metrics.add(b.output(n), b.target(n), Zone::flat);
            for (const float pixel : b.output(n)) highest = std::max(highest, std::abs(pixel));
          }
          return true;
        });
        text += a.text("name") + "," + kind.name + "," + format(kind.strengths[s]) + "," + format(pressed) +
                "," + std::to_string(all.size()) + "," + format(metrics.flat().ghost_rate, 4) + "," +
                format(highest, 3) + "\n";
      }
  write_file(out, text);
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const supertac::Program program{"silent_signals", "Ghosts on signals that stand, are noise, or drift.",
                                  supertac::declare, supertac::run};
  return supertac::run_program(program, argc, argv);
}
