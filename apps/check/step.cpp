// Trainings looked into: one step opened, and the first operator in which two of them part.
#include <algorithm>
#include <filesystem>

#include "apps/check/check.h"
#include "apps/check/repetition.h"
#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "apps/train/run_folder.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
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

// `of`: the training that they are of, where there are two.
Json whose_name_begins(const Json& operators, const std::string& name, const char* of = nullptr) {
  Json some = Json::array();
  for (const Json& ran : operators) {
    if (!ran["name"].get<std::string>().starts_with(name)) continue;
    some.push_back(ran);
    if (of != nullptr) some.back()["of"] = of;
  }
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

// "entry [3,0,17]: 0.25 and 0.26".
std::string entry_of(const Tensor& one, const Tensor& other) {
  const std::optional<Dim> entry = first_different_entry(one, other);
  if (!entry) return "shapes " + one.shape().text() + " and " + other.shape().text();
  std::string index;
  Dim rest = *entry;
  for (int axis = one.rank() - 1; axis >= 0; rest /= one.dim(axis--))
    index = std::to_string(rest % one.dim(axis)) + (index.empty() ? "" : ",") + index;
  return "entry [" + index + "]: " + format(static_cast<double>(one.data()[*entry]), 9) + " and " +
         format(static_cast<double>(other.data()[*entry]), 9);
}

Json to_json(const OperatorDifference& d) {
  return {{"operator", d.name}, {"op", d.op}, {"what", d.what}, {"one", d.one}, {"other", d.other}};
}

// Opens the steps in which the two ledgers part, one after the other in both trainings, until an operator
// differs.
int part(const Arguments& a, const LedgerDifference& lines, Json result) {
  const auto folder = [&](const char* name) {
    const std::filesystem::path file = a.text(name);
    if (file.filename() != std::filesystem::path(LedgerFile::path_in("")).filename())
      throw UsageError(a.text(name) + ": with --data expected the ledger in a run's own folder");
    return file.has_parent_path() ? file.parent_path().string() : std::string(".");
  };
  const auto described = [&](const char* name) { return LedgerFile::state_path(folder(name), 0); };
  Repetition one(a, folder("FILE"), described("FILE")), other(a, folder("OTHER"), described("OTHER"));
  const auto say = [&](const std::string& text) {
    a.print(text);
    result["found"] = text;
    a.write_json(result);
    return kExitFailed;
  };
  for (std::int64_t step = lines.after + 1; step <= lines.step; ++step) {
    OpenedStep opened[2];
    const auto open = [&](std::size_t which, Repetition& training, const OpeningOptions& options) {
      return training.make_step([&] { opened[which] = open_step(training.trainer(), options); });
    };
    if (step == lines.after + 1) {
      if (const auto d = go_before(one, step, a))
        return say(a.text("FILE") + " is not repeated here: " + text_of(*d));
      if (const auto d = go_before(other, step, a))
        return say(a.text("OTHER") + " is not repeated here: " + text_of(*d));
    }
    const auto of_one = open(0, one, {}), of_other = open(1, other, {});
    const auto found = first_difference(opened[0].operators, opened[1].operators);
    if (!found) {
      if (of_one) a.print(a.text("FILE") + " comes out otherwise here: " + text_of(*of_one));
      if (of_other) a.print(a.text("OTHER") + " comes out otherwise here: " + text_of(*of_other));
      continue;
    }
    const Json operators[] = {opened[0].operators, opened[1].operators};
    go_before(one, step, a), go_before(other, step, a);
    open(0, one, {.keep = found->name}), open(1, other, {.keep = found->name});
    opened[0].arrays.merge(opened[1].arrays);
    const auto array = [&](const std::string& hash) { return opened[0].arrays.find(hash); };
    const bool kept =
        array(found->one) != opened[0].arrays.end() && array(found->other) != opened[0].arrays.end();
    const std::string text = "step " + std::to_string(step) + ", " + found->name + ", " + found->what;
    if (a.given("out")) {
      Json both = whose_name_begins(operators[0], found->name, "one");
      for (const Json& ran : whose_name_begins(operators[1], found->name, "other")) both.push_back(ran);
      write_arrays(a.output("out"), opened[0].arrays, both);
    }
    result["step"] = step;
    result["operator"] = to_json(*found);
    return say(kept ? text + ", " + entry_of(array(found->one)->second, array(found->other)->second)
                    : text + ": " + found->one + " and " + found->other);
  }
  return say(
      "both trainings, repeated here from their states, are the same up to step " +
      std::to_string(lines.step) +
      ": one of them was computed otherwise where it ran; open this step there, too (supertac-check step), "
      "and compare what comes out (supertac-check ledgers ONE.json OTHER.json)");
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
  Repetition training(a, RunFolder::folder_of(model), model);
  Trainer& trainer = training.trainer();
  const std::int64_t step = a.integer("at", 1, trainer.total_steps());
  auto d = go_before(training, step, a);
  OpenedStep opened;
  if (!d) {
    d = training.make_step([&] {
      opened = open_step(trainer,
                         {.keep = a.given("operator") ? std::optional(a.text("operator")) : std::nullopt});
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
  const Json result = {{"lines", both}, {"difference", d ? to_json(*d) : Json()}};
  if (d && a.given("data")) return part(a, *d, result);
  a.write_json(result);
  return d ? kExitFailed : kExitOk;
}

}  // namespace supertac
