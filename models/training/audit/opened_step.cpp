#include "models/training/audit/opened_step.h"

#include <array>
#include <mutex>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "autograd/trace.h"
#include "io/numbers/sha256.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

template <class T>
std::string hash_of(std::span<const T> values) {
  Sha256 sum;
  sum.add(std::as_bytes(values));
  return sum.hex();
}
// An array is referred to by hash and shape: "9f86...0a08 [3,4]".
std::string reference_to(const Tensor& tensor) {
  return hash_of(tensor.values()) + " " + tensor.shape().text();
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
  bool keeps(const std::string& name) const { return keep_ && name.starts_with(*keep_); }
  void keep(const std::string& reference, const Tensor& values) {
    const std::lock_guard lock(mutex_);
    if (Tensor& kept = opened_.arrays[reference]; !kept.defined()) kept = values.clone();
  }

  std::unordered_map<const real*, std::string> parameters;  // by the buffer that all micro-batches share

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

  // Those of the forward pass behind what went into it, then those of the reverse pass.
  Json operators(const Batch& batch) {
    Json all = Json::array();
    const auto add_input = [&](const char* what, const Tensor& values) {
      if (!values.defined()) return;
      all.push_back({{"name", prefix_ + what},
                     {"op", what},
                     {"outputs", {kept(prefix_ + what, reference_to(values), values)}}});
    };
    add_input("windows", batch.inputs), add_input("truths", batch.targets), add_input("noise", batch.noise);
    for (std::size_t i = 0; i < ops().size(); ++i) all.push_back(forward(i));
    for (Json& reversed : reverse_) all.push_back(std::move(reversed));
    return all;
  }
  // "" where there is none.
  std::string gradient_of(const Parameter& parameter) {
    const auto found = gradients_.find(parameter.value.node());
    return found == gradients_.end() ? ""
                                     : kept("sum/" + parameter.name, found->second, parameter.value.grad());
  }

 private:
  std::string name_of(std::size_t index) const {
    return prefix_ + std::to_string(1000 + index).substr(1) + "." + std::string(ops()[index].op);
  }
  const std::string& kept(const std::string& name, const std::string& reference, const Tensor& values) {
    if (opening_.keeps(name)) opening_.keep(reference, values);
    return reference;
  }

  std::string value_of(const std::string& name, const Variable& x) {
    std::string& reference = values_[x.node()];
    if (reference.empty()) {
      const auto shared = opening_.parameters.find(x.value().data());
      reference = shared != opening_.parameters.end() ? shared->second : reference_to(x.value());
    }
    return kept(name, reference, x.value());
  }

  Json inputs_of(const std::string& name, const TracedOp& op) {
    Json inputs = Json::array();
    for (const Variable& x : op.inputs) inputs.push_back(value_of(name, x));
    if (const Tensor& constant = op.settings.constant; constant.defined())
      inputs.push_back(kept(name, reference_to(constant), constant));
    return inputs;
  }

  Json forward(std::size_t index) {
    const TracedOp& op = ops()[index];
    const std::string name = name_of(index);
    return {{"name", name},
            {"op", op.op},
            {"settings", settings_of(op)},
            {"inputs", inputs_of(name, op)},
            {"outputs", {value_of(name, op.y)}}};
  }

  void reverse(Backward& b, const std::function<void()>& step) override {
    for (std::size_t i = index_.size(); i < ops().size(); ++i) index_[ops()[i].y.node()] = i;
    const std::size_t index = index_.at(&b.node()), inputs = b.node().input_count;
    const TracedOp& op = ops()[index];
    const std::string name = name_of(index) + "/reverse";
    std::string& gy = gradients_[&b.node()];
    if (gy.empty()) gy = reference_to(b.gy());
    Json ran = {{"name", name},
                {"op", op.op},
                {"settings", settings_of(op)},
                {"inputs", inputs_of(name, op)},
                {"y", value_of(name, op.y)},
                {"gy", kept(name, gy, b.gy())},
                {"before", Json::array()}};
    for (std::size_t i = 0; i < inputs; ++i) {  // a gradient that is there is added to
      const detail::Node* x = b.node().inputs[i];
      const bool added_to = x->requires_grad && x->grad.defined();
      ran["before"].push_back(added_to ? kept(name, gradients_.at(x), x->grad) : "");
    }
    step();
    ran["outputs"] = Json::array();
    for (std::size_t i = 0; i < inputs; ++i) {
      detail::Node* x = b.node().inputs[i];
      const bool made = x->requires_grad && x->grad.defined();
      ran["outputs"].push_back(made ? kept(name, gradients_[x] = reference_to(x->grad), x->grad) : "");
    }
    reverse_.push_back(std::move(ran));
  }

  Opening& opening_;
  std::string prefix_;
  std::unordered_map<const detail::Node*, std::size_t> index_;
  std::unordered_map<const detail::Node*, std::string> values_, gradients_;
  std::vector<Json> reverse_;
};

// The state of a training in the order of its tensors: all parameters, then the two moments of each.
struct State {
  std::vector<std::string> names, references;
  std::vector<Tensor> values;  // handles, no copies

  explicit State(const Trainer& trainer) {
    trainer.for_each_tensor([&](const std::string& name, const Tensor& of) {
      names.push_back(name), values.push_back(of), references.push_back(reference_to(of));
    });
  }
  // Of parameter i of n and its moments.
  static std::array<std::size_t, 3> places(std::size_t i, std::size_t n) {
    return {i, n + 2 * i, n + 2 * i + 1};
  }
};

// Behind the micro-batches: sums of their gradients, the norm over all parameters, the update.
class Update {
 public:
  Update(Trainer& trainer, Opening& opening) : trainer_(trainer), opening_(opening), before_(trainer) {
    const std::vector<Parameter>& parameters = trainer_.model().parameters();
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      opening_.parameters[parameters[i].value.value().data()] = before_.references[i];
      keep(i, before_);
    }
  }
  Json before() const {
    Json all = Json::array();
    for (std::size_t i = 0; i < before_.names.size(); ++i)
      all.push_back(
          {{"name", "state/" + before_.names[i]}, {"op", "state"}, {"outputs", {before_.references[i]}}});
    return all;
  }
  Json sums(const std::function<std::vector<std::string>(std::size_t parameter)>& gradients_of) {
    Json all = Json::array();
    const std::vector<Parameter>& parameters = trainer_.model().parameters();
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      const Tensor& sum = parameters[i].value.grad();
      sums_.push_back(reference_to(sum));
      all.push_back({{"name", "sum/" + parameters[i].name},
                     {"op", "add_as_tree"},
                     {"inputs", gradients_of(i)},
                     {"outputs", {sums_.back()}}});
      for (const std::string& reader :
           {"sum/" + parameters[i].name, std::string("norm"), "update/" + parameters[i].name})
        if (opening_.keeps(reader)) opening_.keep(sums_.back(), sum);
    }
    return all;
  }
  Json applied(const StepReport& report) {
    const State after(trainer_);
    const std::vector<Parameter>& parameters = trainer_.model().parameters();
    const Recipe& pace = trainer_.objective().recipe();
    const AdamOptions adam;
    const double norm = report.gradient_norm;
    Json all = Json::array();
    all.push_back({{"name", "norm"},
                   {"op", "norm"},
                   {"value", norm},
                   {"inputs", sums_},
                   {"outputs", {hash_of(std::span(&norm, 1))}}});
    const Json settings = {{"norm", norm},
                           {"clip_norm", pace.clip_norm},
                           {"step", report.step},
                           {"learning_rate", report.learning_rate}};
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      const bool muon = pace.muon && is_matrix(parameters[i].value.shape());
      Json ran = {
          {"name", "update/" + parameters[i].name}, {"op", muon ? "muon" : "adam"}, {"settings", settings}};
      if (!muon)
        ran["settings"].update({{"beta1", adam.beta1}, {"beta2", adam.beta2}, {"epsilon", adam.epsilon}});
      for (const std::size_t place : State::places(i, parameters.size())) {
        ran["inputs"].push_back(before_.references[place]);
        ran["outputs"].push_back(after.references[place]);
      }
      ran["inputs"].push_back(sums_[i]);
      all.push_back(std::move(ran));
      keep(i, after);
    }
    return all;
  }

 private:
  void keep(std::size_t parameter, const State& state) {
    const std::vector<Parameter>& parameters = trainer_.model().parameters();
    for (const std::size_t place : State::places(parameter, parameters.size()))
      if (opening_.keeps("update/" + parameters[parameter].name) ||
          opening_.keeps("state/" + state.names[place]))
        opening_.keep(state.references[place], state.values[place]);
  }

  Trainer& trainer_;
  Opening& opening_;
  State before_;
  std::vector<std::string> sums_;
};

}  // namespace

OpenedStep open_step(Trainer& trainer, const std::optional<std::string>& keep) {
  if (trainer.ranks() > 1)
    throw std::invalid_argument("open_step: expected a training in one process, found " +
                                std::to_string(trainer.ranks()));
  OpenedStep opened{.step = trainer.step() + 1, .operators = Json::array(), .arrays = {}};
  Opening opening(keep, opened);
  Update update(trainer, opening);
  const auto append = [&](const Json& more) {
    opened.operators.insert(opened.operators.end(), more.begin(), more.end());
  };
  append(update.before());

  struct Ran {
    Json operators;
    std::vector<std::string> gradients;
  };
  std::array<Ran, kMostMicroBatches> ran;
  const StepReport report =
      trainer.train_step({}, [&](std::size_t number, const MicroBatchView& micro_batch, const auto& run) {
        MicroBatchWatch watch(opening, number);
        run();
        ran[number].operators = watch.operators(micro_batch.batch);
        for (const Parameter& p : micro_batch.parameters)
          ran[number].gradients.push_back(watch.gradient_of(p));
      });
  opened.operators.push_back({{"name", "batch"},
                              {"op", "batch"},
                              {"examples", trainer.batch()},
                              {"outputs", {hash_of(trainer.batch())}}});
  for (const Ran& of : ran)
    if (!of.operators.is_null()) append(of.operators);
  append(update.sums([&](std::size_t parameter) {
    std::vector<std::string> gradients;
    for (const Ran& of : ran)
      if (!of.gradients.empty() && !of.gradients[parameter].empty())
        gradients.push_back(of.gradients[parameter]);
    return gradients;
  }));
  append(update.applied(report));
  return opened;
}

std::optional<OperatorDifference> first_difference(const Json& one, const Json& other) {
  const auto refuse = [](const std::string& what) {
    throw std::invalid_argument("opened steps: expected two of the same network and recipe, found " + what);
  };
  if (one.size() != other.size())
    refuse(std::to_string(one.size()) + " and " + std::to_string(other.size()) + " operators");
  for (std::size_t i = 0; i < one.size(); ++i) {
    const Json &a = one[i], &b = other[i];
    const std::string name = a.at("name"), op = a.at("op");
    if (name != b.at("name")) refuse(name + " and " + b.at("name").get<std::string>());
    const auto settings_in = [](const Json& ran) {
      return ran.contains("settings") ? ran["settings"].dump() : "";
    };
    for (const char* field : {"inputs", "outputs"}) {
      const Json none = Json::array();
      const Json &x = a.contains(field) ? a[field] : none, &y = b.contains(field) ? b[field] : none;
      if (x.size() != y.size()) refuse(name + " with other " + field);
      if (field == std::string("outputs") && settings_in(a) != settings_in(b))
        return OperatorDifference{name, op, "the settings", settings_in(a), settings_in(b)};
      for (std::size_t k = 0; k < x.size(); ++k)
        if (x[k] != y[k])
          return OperatorDifference{
              name, op, (field == std::string("inputs") ? "input " : "output ") + std::to_string(k), x[k],
              y[k]};
    }
  }
  return std::nullopt;
}

}  // namespace supertac
