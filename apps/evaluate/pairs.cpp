#include "apps/evaluate/pairs.h"

#include <algorithm>
#include <map>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/output/remarks.h"
#include "apps/common/running/measure.h"
#include "apps/evaluate/scoring.h"
#include "data/plates/truth.h"
#include "data/scores/metrics.h"
#include "data/windows/signal_remarks.h"
#include "io/files/safetensors.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

/// Scores of the network and of every baseline, by their names.
class PairScores {
 public:
  PairScores(const ImageGrid& image, const Baselines& baselines) {
    const PairMetrics none(static_cast<std::size_t>(image.height), static_cast<std::size_t>(image.width));
    methods_.emplace_back("network", none);
    for (const auto& baseline : baselines) methods_.emplace_back(baseline->name(), none);
  }
  void add(const Drawn& d) {
    for (std::size_t m = 0; m < methods_.size(); ++m) methods_[m].second.add(d.pictures[m], d.target);
  }
  nlohmann::ordered_json to_json() const {
    nlohmann::ordered_json json;
    for (const auto& [name, scores] : methods_) {
      const Metrics metrics = scores.result();
      json["pairs"] = metrics.windows;
      json[name] = {{"psnr_mean_db", metrics.psnr_mean_db},
                    {"psnr_pooled_db", metrics.psnr_pooled_db},
                    {"ssim", metrics.ssim}};
    }
    return json;
  }
  void print(const Arguments& a, const std::string& title) const {
    a.print(title + ", " + std::to_string(methods_.front().second.result().windows) +
            " pairs:   SSIM  PSNR dB");
    for (const auto& [name, scores] : methods_) {
      const Metrics metrics = scores.result();
      a.print("  " + name + std::string(12 - name.size(), ' ') + cell(format(metrics.ssim, 3), 9) +
              cell(format(metrics.psnr_mean_db, 2), 9));
    }
  }

 private:
  std::vector<std::pair<std::string, PairMetrics>> methods_;
};

/// Numbers, groups, outputs and targets of the pairs drawn, as the file of pairs has them.
class PairOutputs {
 public:
  void add(const PairSet& pairs, const Drawn& d) {
    indices_.push_back(static_cast<std::int64_t>(d.example));
    groups_.push_back(pairs.group(d.example));
    output_.insert(output_.end(), d.pictures[0].begin(), d.pictures[0].end());
    target_.insert(target_.end(), d.target.begin(), d.target.end());
  }
  void write(const OutputPath& output, const ImageGrid& image) const {
    const std::uint64_t n = indices_.size(), h = static_cast<std::uint64_t>(image.height),
                        w = static_cast<std::uint64_t>(image.width);
    const auto bytes = [](const auto& values) { return std::as_bytes(std::span(values)); };
    write_safetensors(output, {{"format", "supertac-outputs"}},
                      {{"index", "I64", {n}, bytes(indices_)},
                       {"group", "I64", {n}, bytes(groups_)},
                       {"output", "F32", {n, 1, h, w}, bytes(output_)},
                       {"target", "F32", {n, 1, h, w}, bytes(target_)}});
  }

 private:
  std::vector<std::int64_t> indices_, groups_;
  std::vector<float> output_, target_;
};

}  // namespace

int evaluate_on_pairs(const Arguments& a) {
  const std::vector<ModelFile> files = load_models(a.list("model"), ModelKind::frames);
  const Ensemble network = ensemble_of(files, precision_of(a.choice("precision", {"fp32", "int8"})));
  TestSet tested = test_set_of(a, files.front(), {"group", "pair", "none"});
  PairSet pairs = PairSet::read(a.text("pairs"));
  pairs.set_scaling(files.front().scaling);
  add_model_parents(a.list("model"));
  add_parent_file("pairs", a.text("pairs"));
  tested.split = split_pairs(pairs, tested.split_name, tested.seed);
  check_test_set(a, files, tested);
  remark(a, remarks_on(pairs));

  if (const int side = std::min(pairs.image().height, pairs.image().width); side < 7)
    a.note("targets of " + pairs.image().text() + " pixels: SSIM's window is " +
           std::to_string((side - 1) / 2 * 2 + 1) +
           " pixels wide instead of 7; compare it with others of that size only");
  const Baselines baselines = fit_baselines(pairs, tested.split.train);
  const PairScores none(pairs.image(), baselines);
  PairScores all = none, contact = none;
  std::map<std::int64_t, PairScores> groups;
  PairOutputs outputs;
  draw_all(a, network, pairs, tested.split.test, baselines, [&](const Drawn& d) {
    all.add(d);
    groups.try_emplace(pairs.group(d.example), none).first->second.add(d);
    if (in_contact(d.target)) contact.add(d);
    if (a.given("outputs")) outputs.add(pairs, d);
  });

  all.print(a, "split " + tested.split_name + ", seed " + std::to_string(tested.seed));
  contact.print(a, "targets that are not all 0");
  const Tensor frame = Tensor::full(network.first().input_shape(1), 0.5F);
  const Latency latency = measure_latency([&] { network.infer(frame); });
  a.print("one picture in " + format(latency.median_us, 1) + " us");
  nlohmann::ordered_json result = {
      {"contact", contact.to_json()}, {"all", all.to_json()}, {"latency", {{"network", latency.to_json()}}}};
  for (const auto& [number, scores] : groups) {
    if (!pairs.grouped()) break;
    scores.print(a, "group " + std::to_string(number));
    result["groups"][std::to_string(number)] = scores.to_json();
  }
  result["model"] = a.text("model");
  result["data"] = pairs.fingerprint();
  result["split"] = tested.split_name;
  result["seed"] = tested.seed;
  if (a.given("outputs")) outputs.write(a.output("outputs"), pairs.image());
  a.write_json(result);
  return kExitOk;
}

}  // namespace supertac
