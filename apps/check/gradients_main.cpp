// supertac-check-gradients: what `supertac-check gradients` runs, compiled with real = double.
#include <algorithm>
#include <chrono>
#include <span>
#include <string>

#include "apps/check/gradient_cases.h"
#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "autograd/reverse_watch.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {

void declare(Arguments& a) {
  a.option(
      "break", "OP",
      "plant an error in the reverse step of this op, or of 'all', one after the other: the gradient of each "
      "input with the wrong sign, doubled, without one of its terms, at the wrong index; each has to be "
      "found");
}

namespace {

using Json = nlohmann::ordered_json;

Json to_json(const GradientEntry& e) {
  return {{"entry", e.place},
          {"analytic", e.analytic},
          {"numeric", e.numeric},
          {"relative_error", e.relative_error}};
}

std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string text_of(const GradientEntry& e) {
  return e.place + ": analytic " + short_text(e.analytic) + ", numeric " + short_text(e.numeric);
}

void print_row(const Arguments& a, const CheckedGradients& c) {
  a.print(left_aligned(c.kind, 7) + left_aligned(c.name, 26) + left_aligned(std::to_string(c.entries), 9) +
          left_aligned(short_text(c.worst.relative_error), 10) + (c.wrong() ? "WRONG  " : "ok     ") +
          text_of(c.worst));
}

int check_all(const Arguments& a) {
  std::vector<GradientCase> cases = op_cases();
  for (const auto& more : {layer_cases(), loss_cases()}) cases.insert(cases.end(), more.begin(), more.end());
  const auto begin = std::chrono::steady_clock::now();
  a.print(left_aligned("kind", 7) + left_aligned("name", 26) + left_aligned("entries", 9) +
          left_aligned("error", 10) + "       worst entry");
  Json rows = Json::array();
  std::size_t wrong = 0;
  Dim entries = 0;
  const auto runs = by_name(cases);
  Progress progress(a, "checking", runs.size(), "rows");
  for (const auto& run : runs) {
    stop_if_interrupted();
    const CheckedGradients c = check(run);
    progress.update(rows.size() + 1);
    print_row(a, c);
    wrong += c.wrong();
    entries += c.entries;
    rows.push_back({{"kind", c.kind},
                    {"name", c.name},
                    {"entries", c.entries},
                    {"wrong", c.wrong()},
                    {"worst", to_json(c.worst)}});
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  a.print(std::to_string(entries) + " entries in " + format(seconds, 1) + " s, " + std::to_string(wrong) +
          " of " + std::to_string(rows.size()) + " rows wrong (relative error above " +
          format(kGradientTolerance) + ")");
  a.write_json({{"rows", rows}, {"entries", entries}, {"wrong", wrong}, {"seconds", seconds}});
  return wrong == 0 ? kExitOk : kExitFailed;
}

// An error in the reverse step of one op, put there to see whether the check finds and names it.
struct Plant {
  enum class Kind { sign, factor, term, index };
  std::string op;         // "conv2d"
  std::size_t input = 0;  // whose gradient is spoiled
  Kind kind = Kind::sign;
};
// sign: -g.  factor: 2 g.  term: one element of dL/dy is left out of g.  index: g, each element one place on.
constexpr std::pair<Plant::Kind, const char*> kPlantKinds[] = {{Plant::Kind::sign, "sign"},
                                                               {Plant::Kind::factor, "factor"},
                                                               {Plant::Kind::term, "term"},
                                                               {Plant::Kind::index, "index"}};

// What the reverse step adds to the gradient of one input, as a tensor of its own; the gradient itself is put
// back to what it was.
Tensor added_by(const std::function<void()>& step, Tensor& gradient) {
  const Tensor before = gradient.clone();
  step();
  Tensor added = gradient.clone();
  for (Dim i = 0; i < added.size(); ++i) added.data()[i] -= before.data()[i];
  std::copy_n(before.data(), before.size(), gradient.data());
  return added;
}

// While it lives, what the op's reverse step adds to the gradient of that input is spoiled.
class PlantedError : public ReverseWatch {
 public:
  explicit PlantedError(Plant plant) : plant_(std::move(plant)) {}
  // Whether any gradient became another one: the same number everywhere is the same at every index.
  bool changed() const { return changed_; }

  // The step runs twice: as it is for the other inputs, then once more for this one alone.
  void reverse(const char* op, std::size_t inputs, Backward& b, const std::function<void()>& step) override {
    Tensor* gradient = plant_.op == op && plant_.input < inputs ? b.grad_of(plant_.input) : nullptr;
    if (gradient == nullptr || gradient->size() == 0) return step();
    std::vector<Tensor> others(inputs);
    const Tensor gy = b.gy().clone();
    const Tensor right = added_by(step, *gradient);
    for (std::size_t i = 0; i < inputs; ++i)
      if (const Tensor* g = b.grad_of(i); g != nullptr && g != gradient) others[i] = g->clone();
    Tensor wrong = right.clone();
    if (plant_.kind == Plant::Kind::term) {
      std::copy_n(gy.data(), gy.size(), b.mutable_gy().data());
      b.mutable_gy().data()[gy.size() / 2] = 0;
      wrong = added_by(step, *gradient);
    } else if (plant_.kind == Plant::Kind::index) {
      std::rotate(wrong.data(), wrong.data() + wrong.size() - 1, wrong.data() + wrong.size());
    } else {
      for (real& g : wrong.values()) g *= plant_.kind == Plant::Kind::sign ? -1 : 2;
    }
    for (std::size_t i = 0; i < inputs; ++i)
      if (others[i].defined()) std::copy_n(others[i].data(), others[i].size(), b.grad_of(i)->data());
    for (Dim i = 0; i < wrong.size(); ++i) {
      gradient->data()[i] += wrong.data()[i];
      changed_ = changed_ || wrong.data()[i] != right.data()[i];
    }
  }

 private:
  Plant plant_;
  bool changed_ = false;
};

// The ops whose rows are wrong while the error is there.
std::vector<CheckedGradients> wrong_rows(std::span<const std::span<const GradientCase>> runs) {
  std::vector<CheckedGradients> wrong;
  for (const auto& run : runs)
    if (CheckedGradients c = check(run); c.wrong()) wrong.push_back(std::move(c));
  return wrong;
}

struct Tally {
  std::size_t planted = 0, found = 0;
  Json rows = Json::array();
};

void plant(const Arguments& a, const Plant& p, const char* kind, const std::string& input,
           std::span<const std::span<const GradientCase>> runs, Tally& tally) {
  PlantedError error(p);
  const std::vector<CheckedGradients> wrong = wrong_rows(runs);
  if (!error.changed()) return;  // the same gradient: at every index the same number
  const bool found = wrong.size() == 1 && wrong.front().name == p.op;
  ++tally.planted;
  tally.found += found;
  a.print(left_aligned(input, 36) + left_aligned(kind, 8) +
          (found ? "found: " + text_of(wrong.front().worst)
                 : "NOT FOUND, " + std::to_string(wrong.size()) + " rows wrong"));
  Json row = {{"op", p.op}, {"input", input}, {"error", kind}, {"found", found}};
  if (found) row["worst"] = to_json(wrong.front().worst);
  tally.rows.push_back(std::move(row));
}

int break_ops(const Arguments& a, const std::string& op) {
  const std::vector<GradientCase> cases = op_cases();
  const auto runs = by_name(cases);
  std::vector<std::string> names{"all"};
  for (const auto& run : runs) names.push_back(run.front().name);
  a.choice("break", names);
  Tally tally;
  std::vector<std::pair<const GradientCase*, std::size_t>> inputs;
  for (const auto& run : runs) {
    const GradientCase& c = run.front();
    if (op != "all" && op != c.name) continue;
    for (std::size_t input = 0; input < c.leaves.size(); ++input) inputs.emplace_back(&c, input);
  }
  Progress progress(a, "planting", inputs.size(), "inputs");
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const auto& [c, input] = inputs[i];
    for (const auto& [kind, name] : kPlantKinds) {
      stop_if_interrupted();
      plant(a, {c->name, input, kind}, name, c->options.names[input], runs, tally);
    }
    progress.update(i + 1);
  }
  a.print(std::to_string(tally.found) + " of " + std::to_string(tally.planted) +
          " planted errors found and named");
  a.write_json({{"planted", tally.planted}, {"found", tally.found}, {"rows", tally.rows}});
  return tally.found == tally.planted ? kExitOk : kExitFailed;
}

}  // namespace

int run(Arguments& a) { return a.given("break") ? break_ops(a, a.text("break")) : check_all(a); }

}  // namespace supertac
