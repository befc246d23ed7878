#include "models/training/audit/opened_step.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "autograd/trace.h"
#include "io/numbers/hash.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

template <class T>
std::string hash_of(std::span<const T> values) {
  Sha256 sum;
  sum.add(std::as_bytes(values));
  return sum.hex();
}

// What docs/audit.md calls the settings of an operator.
Json settings_of(const TracedOp& op) {
  const OpSettings& s = op.settings;
  const auto dims = op.y.shape().dims();
  Json settings = {{"shape", std::vector<Dim>(dims.begin(), dims.end())}};
  if (op.op.starts_with("conv"))
    settings.update({{"stride", s.conv.stride_w}, {"padding", s.conv.padding_w}});
  if (op.op.starts_with("conv") || op.op == "linear" || op.op.ends_with("relu"))
    settings["slope"] = s.negative_slope;
  if (op.op == "take_runs") settings.update({{"first", s.first}, {"run", s.run}, {"step", s.step}});
  if (op.op == "scale") settings["factor"] = s.factor;
  if (op.op == "clamp") settings.update({{"low", s.low}, {"high", s.high}});
  return settings;
}

// What all micro-batches of one opening share.
class Opening {
 public:
  Opening(const std::optional<std::string>& keep, OpenedStep& opened) : keep_(keep), opened_(opened) {}

  /// How the operator `reader` refers to an array: by hash and shape, "9f86...0a08 [3,4]"; "" where there is
  /// none. Kept where that operator's arrays are.
  std::string note(const std::string& reader, const Tensor& values) {
    if (!values.defined()) return "";
    std::string reference = hash_of(values.values()) + " " + values.shape().text();
    if (keep_ && reader.starts_with(*keep_)) {
      const std::lock_guard lock(mutex_);
      if (Tensor& kept = opened_.arrays[reference]; !kept.defined()) kept = values.clone();
    }
    return reference;
  }

 private:
  const std::optional<std::string>& keep_;
  OpenedStep& opened_;
  std::mutex mutex_;
};

// The operators of one micro-batch.
class MicroBatchWatch : Trace, ReverseWatch {
 public:
  MicroBatchWatch(Opening& opening, std::size_t number)
      : opening_(opening), prefix_(std::to_string(number) + "/") {}

  // What went in, the operators of the forward pass, then those of the reverse pass.
  Json operators(const Batch& batch) {
    Json all = Json::array();
    const std::pair<const char*, const Tensor&> given[] = {
        {"windows", batch.inputs}, {"truths", batch.targets}, {"noise", batch.noise}};
    for (const auto& [what, values] : given)
      if (const std::string name = prefix_ + what; values.defined())
        all.push_back({{"name", name}, {"op", what}, {"outputs", {opening_.note(name, values)}}});
    for (std::size_t i = 0; i < ops().size(); ++i) {
      Json ran = inputs_of(i, "");
      ran["outputs"] = {opening_.note(ran["name"], ops()[i].y.value())};
      all.push_back(std::move(ran));
    }
    all.insert(all.end(), reverse_.begin(), reverse_.end());
    return all;
  }

 private:
  Json inputs_of(std::size_t index, const char* way) {
    const TracedOp& op = ops()[index];
    std::string number = std::to_string(index);
    number.insert(0, 3 - std::min<std::size_t>(3, number.size()), '0');
    const std::string name = prefix_ + number + "." + std::string(op.op) + way;
    Json inputs = Json::array();
    for (const Variable& x : op.inputs) inputs.push_back(opening_.note(name, x.value()));
    if (op.settings.constant.defined()) inputs.push_back(opening_.note(name, op.settings.constant));
    return {{"name", name}, {"op", op.op}, {"settings", settings_of(op)}, {"inputs", inputs}};
  }
  Json gradients_of_inputs(const std::string& name, const detail::Node& y) {
    Json gradients = Json::array();
    for (std::size_t i = 0; i < y.input_count; ++i)
      gradients.push_back(y.inputs[i]->requires_grad ? opening_.note(name, y.inputs[i]->grad) : "");
    return gradients;
  }

  void reverse(Backward& b, const std::function<void()>& step) override {
    const auto op = std::ranges::find(ops(), &b.node(), [](const TracedOp& o) { return o.y.node(); });
    Json ran = inputs_of(static_cast<std::size_t>(op - ops().begin()), "/reverse");
    const std::string name = ran["name"];
    ran["y"] = opening_.note(name, b.y());
    ran["gy"] = opening_.note(name, b.gy());
    ran["before"] = gradients_of_inputs(name, b.node());  // a gradient that is there is added to
    step();
    ran["outputs"] = gradients_of_inputs(name, b.node());
    reverse_.push_back(std::move(ran));
  }

  Opening& opening_;
  std::string prefix_;
  Json reverse_ = Json::array();
};

// Every parameter with its two moments, as `update/NAME` reads or makes them.
std::vector<Json> states_of(const Trainer& trainer, Opening& opening) {
  const std::vector<Parameter>& parameters = trainer.model().parameters();
  std::vector<Json> states(parameters.size(), Json::array());
  std::size_t number = 0;  // all parameters come first, then the moments of each
  trainer.for_each_tensor([&](const std::string&, const Tensor& of) {
    const std::size_t n = parameters.size(), i = number < n ? number : (number - n) / 2;
    states[i].push_back(opening.note("update/" + parameters[i].name, of));
    ++number;
  });
  return states;
}

// Behind the micro-batches: sums of their gradients, the norm over all parameters, the update.
void add_update(Json& operators, const Trainer& trainer, Opening& opening, const StepReport& report,
                std::vector<Json> before, const std::vector<std::vector<std::string>>& gradients) {
  const std::vector<Parameter>& parameters = trainer.model().parameters();
  const Recipe& recipe = trainer.recipe();
  const AdamOptions adam;
  const double norm = report.gradient_norm;
  Json sums = Json::array();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const std::string name = "sum/" + parameters[i].name;
    const Tensor& sum = parameters[i].value.grad();
    sums.push_back(opening.note("norm", sum));
    before[i].push_back(opening.note("update/" + parameters[i].name, sum));
    operators.push_back({{"name", name},
                         {"op", "add_as_tree"},
                         {"inputs", gradients[i]},
                         {"outputs", {opening.note(name, sum)}}});
  }
  operators.push_back({{"name", "norm"},
                       {"op", "norm"},
                       {"value", norm},
                       {"inputs", sums},
                       {"outputs", {hash_of(std::span(&norm, 1))}}});
  const std::vector<Json> after = states_of(trainer, opening);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const bool muon = recipe.muon && is_matrix(parameters[i].value.shape());
    Json settings = {{"norm", norm},
                     {"clip_norm", recipe.clip_norm},
                     {"step", report.step},
                     {"learning_rate", report.learning_rate}};
    if (!muon) settings.update({{"beta1", adam.beta1}, {"beta2", adam.beta2}, {"epsilon", adam.epsilon}});
    operators.push_back({{"name", "update/" + parameters[i].name},
                         {"op", muon ? "muon" : "adam"},
                         {"settings", settings},
                         {"inputs", before[i]},
                         {"outputs", after[i]}});
  }
}

}  // namespace

OpenedStep open_step(Trainer& trainer, const std::optional<std::string>& keep) {
  if (trainer.ranks() > 1)
    refuse("open_step", "trainer", "a training in one process", std::to_string(trainer.ranks()));
  OpenedStep opened{.step = trainer.step() + 1, .operators = Json::array(), .arrays = {}};
  Opening opening(keep, opened);
  trainer.for_each_tensor([&](const std::string& name, const Tensor& of) {
    opened.operators.push_back(
        {{"name", "state/" + name}, {"op", "state"}, {"outputs", {opening.note("state/" + name, of)}}});
  });
  const std::vector<Json> before = states_of(trainer, opening);
  std::array<Json, kMostMicroBatches> operators;
  std::array<std::vector<std::string>, kMostMicroBatches> gradients;
  const StepReport report = trainer.train_step(
      {},
      [&](std::size_t number, const Batch& batch, const std::vector<Parameter>& parameters, const auto& run) {
        MicroBatchWatch watch(opening, number);
        run();
        operators[number] = watch.operators(batch);
        for (const Parameter& p : parameters)
          gradients[number].push_back(opening.note("sum/" + p.name, p.value.grad()));
      });
  opened.operators.push_back({{"name", "batch"},
                              {"op", "batch"},
                              {"examples", trainer.last_windows()},
                              {"outputs", {hash_of(trainer.last_windows())}}});
  std::vector<std::vector<std::string>> of_parameters(trainer.model().parameters().size());
  for (std::size_t number = 0; number < operators.size(); ++number) {
    opened.operators.insert(opened.operators.end(), operators[number].begin(), operators[number].end());
    for (std::size_t i = 0; i < gradients[number].size(); ++i)
      if (!gradients[number][i].empty()) of_parameters[i].push_back(gradients[number][i]);
  }
  add_update(opened.operators, trainer, opening, report, before, of_parameters);
  return opened;
}

}  // namespace supertac
