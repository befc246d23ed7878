#include "apps/check/check.h"

#include <algorithm>

#include "apps/check/repetition.h"
#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "io/numbers/hash.h"
#include "io/numbers/random.h"
#include "models/files/model_file.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;
using Segment = Repetition::Segment;

// Those to be repeated, drawn without looking at them, in their order.
std::vector<Segment> drawn(std::vector<Segment> segments, std::size_t count, std::uint64_t seed) {
  const RandomStream random(seed, stream_of("audit"));
  for (std::size_t i = 0; i + 1 < segments.size(); ++i) {
    const auto rest = static_cast<double>(segments.size() - i);
    std::swap(segments[i], segments[i + static_cast<std::size_t>(random.uniform(i) * rest)]);
  }
  segments.resize(std::min(count, segments.size()));
  std::sort(segments.begin(), segments.end(),
            [](const Segment& x, const Segment& y) { return x.from < y.from; });
  return segments;
}

// The model file has to hold the parameters of the last state.
bool is_of(const std::string& model, const SuperTac& network) {
  const ModelFile file = load_model(model);
  const auto& a = network.parameters();
  const auto& b = file.model->parameters();
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Parameter& x, const Parameter& y) {
    const auto p = std::as_bytes(x.value.value().values()), q = std::as_bytes(y.value.value().values());
    return x.name == y.name && std::equal(p.begin(), p.end(), q.begin(), q.end());
  });
}

}  // namespace

int check_training(const Arguments& a) {
  const std::string model = a.text("FILE");
  Repetition training(a, model);
  Trainer& trainer = training.trainer();
  const std::vector<Segment> all = training.segments();
  const std::vector<Segment> chosen =
      drawn(all, static_cast<std::size_t>(a.integer("segments", 1, 1000)), a.seed());

  Json rows = Json::array();
  std::size_t wrong = 0;
  const auto say = [&](const std::string& what, const std::optional<LedgerDifference>& d, Json row) {
    a.print(what + (d ? text_of(*d) : "the same"));
    if (d) row["difference"] = to_json(*d);
    wrong += d.has_value();
    rows.push_back(std::move(row));
  };
  std::int64_t steps = 0, done = 0;
  for (const Segment& s : chosen) steps += s.to - s.from;
  std::optional<Progress> progress(std::in_place, a, "repeating", static_cast<std::uint64_t>(steps), "steps");
  for (const Segment& s : chosen) {
    auto d = training.start(s.from);
    for (; !d && trainer.step() < s.to; progress->update(static_cast<std::uint64_t>(++done)))
      d = training.make_step();
    say("steps " + std::to_string(s.from) + " to " + std::to_string(s.to) + ": ", d,
        {{"from", s.from}, {"to", s.to}});
  }
  progress.reset();
  auto last = training.start(trainer.total_steps());
  if (!last && !is_of(model, trainer.model()))
    last = LedgerDifference{trainer.step(), trainer.step(), "the model's file", false};
  say("the model against the last state: ", last, {{"model", model}});
  a.print(std::to_string(chosen.size()) + " of " + std::to_string(all.size()) + " segments repeated, " +
          std::to_string(wrong) + " differences");
  a.write_json(
      {{"segments", all.size()}, {"repeated", chosen.size()}, {"differences", wrong}, {"rows", rows}});
  return wrong == 0 ? kExitOk : kExitFailed;
}

}  // namespace supertac
