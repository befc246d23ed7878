#include "layers/module.h"

#include <cmath>

#include "autograd/record.h"

namespace supertac {

Dim Module::parameter_count() const {
  Dim n = 0;
  for (const Parameter& p : parameters_) n += p.value.size();
  return n;
}

Variable Module::add_parameter(const std::string& name, Tensor value, Layout layout) {
  return parameters_.emplace_back(Parameter{name, Variable(std::move(value), true), layout}).value;
}

void Module::add_parameters(const std::string& name, const Module& part) {
  for (const Parameter& p : part.parameters())
    parameters_.push_back({name + "." + p.name, p.value, p.layout});
}

std::vector<Variable> values_of(const std::vector<Parameter>& parameters) {
  std::vector<Variable> values;
  for (const Parameter& p : parameters) values.push_back(p.value);
  return values;
}

Tensor uniform_fan_in(const Shape& shape, Dim fan_in, Rng& rng) {
  if (fan_in < 1) refuse("uniform_fan_in", "shape", "an input and a kernel of 1 or more", shape.text());
  if (rng.draws_zeros()) return Tensor::zeros(shape);
  Tensor t(shape);
  const double bound = 1 / std::sqrt(static_cast<double>(fan_in));
  for (real& x : t.values()) x = rng.uniform(bound);
  return t;
}

}  // namespace supertac
