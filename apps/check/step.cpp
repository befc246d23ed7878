// Trainings looked into: one step opened, and the first line or operator in which two of them part.
#include <algorithm>

#include "apps/check/check.h"
#include "apps/check/repetition.h"
#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "models/training/audit/opened_step.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

constexpr JsonLimits kLimits{.max_bytes = std::size_t{256} << 20, .max_values = 10'000'000};

// The arrays under their hashes, and what the operators are that they belong to.
void write_arrays(const OutputPath& out, const std::map<std::string, Tensor>& arrays, const Json& operators) {
  std::vector<TensorToWrite> tensors;
  for (const auto& [hash, values] : arrays) {
    std::vector<std::uint64_t> shape;
    for (const Dim d : values.shape().dims()) shape.push_back(static_cast<std::uint64_t>(d));
    tensors.push_back({hash, "F32", shape, std::as_bytes(values.values())});
  }
  write_safetensors(out, {{"kind", "operators"}, {"operators", operators.dump()}}, tensors);
}

Json whose_name_begins(const Json& operators, const std::string& name) {
  Json some = Json::array();
  for (const Json& ran : operators)
    if (ran["name"].get<std::string>().starts_with(name)) some.push_back(ran);
  return some;
}

// Repeats the training up to the step before this one.
std::optional<LedgerDifference> go_before(Repetition& training, std::int64_t step, const Arguments& a) {
  auto d = training.start(step - 1);
  const std::int64_t from = training.trainer().step();
  Progress progress(a, "repeating", static_cast<std::uint64_t>(step - from), "steps");
  for (; !d && training.trainer().step() < step - 1;
       progress.update(static_cast<std::uint64_t>(training.trainer().step() - from)))
    d = training.make_step();
  return d;
}

Json to_json(const OperatorDifference& d) {
  return {{"operator", d.name}, {"op", d.op}, {"what", d.what}, {"one", d.one}, {"other", d.other}};
}

Json opened_in(const std::string& path) {
  try {
    return parse_json_limited(read_text_file(path, kLimits.max_bytes), kLimits).at("operators");
  } catch (const std::exception&) {
    throw FileError(path, "is neither a ledger nor what supertac-check step --json FILE has written");
  }
}

}  // namespace

int check_step(const Arguments& a) {
  if (a.given("out") != a.given("operator"))
    throw UsageError("step: --operator says whose arrays --out holds; give both or neither");
  const std::string model = a.text("FILE");
  Repetition training(a, model);
  Trainer& trainer = training.trainer();
  const std::int64_t step = a.integer("step", 1, trainer.total_steps());
  auto d = go_before(training, step, a);
  OpenedStep opened;
  if (!d) {
    d = training.make_step([&] {
      opened = open_step(trainer, a.given("operator") ? std::optional(a.text("operator")) : std::nullopt);
    });
  }
  while (!d && !training.line()) d = training.make_step();  // up to the line that holds it
  const Json kept =
      a.given("operator") ? whose_name_begins(opened.operators, a.text("operator")) : Json::array();
  if (a.given("operator") && kept.empty() && !d)
    throw UsageError("--operator " + a.text("operator") +
                     ": no operator of this step has a name that begins so; --json "
                     "FILE lists them");
  if (a.given("out") && opened.arrays.empty() && !d)
    throw UsageError("--operator " + a.text("operator") + ": what begins so is computed from nothing");
  if (a.given("out")) write_arrays(a.output("out"), opened.arrays, kept);
  const LedgerLine line = training.line().value_or(LedgerLine());
  a.print(
      "step " + std::to_string(step) + ": " + std::to_string(opened.operators.size()) +
      " operators; the ledger " +
      (d ? text_of(*d) : "has the same line at step " + std::to_string(line.step) + ", chain " + line.chain));
  a.write_json({{"step", step},
                {"line", {{"step", line.step}, {"chain", line.chain}}},
                {"difference", d ? to_json(*d) : Json()},
                {"operators", opened.operators}});
  return d ? kExitFailed : kExitOk;
}

int check_ledgers(const Arguments& a) {
  if (a.text("FILE").ends_with(".json")) {  // opened steps
    const auto found = first_difference(opened_in(a.text("FILE")), opened_in(a.text("OTHER")));
    a.print(found ? found->name + ", " + found->what + ": " + found->one + " and " + found->other
                  : "the same");
    a.write_json({{"difference", found ? to_json(*found) : Json()}});
    return found ? kExitFailed : kExitOk;
  }
  const Ledger one = Ledger::read(a.text("FILE")), two = Ledger::read(a.text("OTHER"));
  const auto d = first_difference(one, two);
  const std::size_t both = std::min(one.lines.size(), two.lines.size());
  a.print(d ? text_of(*d)
            : "the same in " + std::to_string(both) + " lines" +
                  (one.lines.size() != two.lines.size() ? ", behind which one of them ends" : ""));
  a.write_json({{"lines", both}, {"difference", d ? to_json(*d) : Json()}});
  return d ? kExitFailed : kExitOk;
}

}  // namespace supertac
