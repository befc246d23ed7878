// Module: something with named parameters. Layers are values made of other layers; a copy shares the
// parameters.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "autograd/variable.h"
#include "io/numbers/random.h"

namespace supertac {

/// Draws numbers one after another from a counter-based stream: the same seed gives the same layers.
class Rng {
 public:
  explicit Rng(std::uint64_t seed) : stream_(seed, 0) {}
  /// For layers whose values come from a file: uniform_fan_in() then makes zeros and draws nothing.
  static Rng zeros() {
    Rng rng(0);
    rng.zeros_ = true;
    return rng;
  }
  bool draws_zeros() const { return zeros_; }
  /// Uniform in [-bound, bound).
  real uniform(double bound) { return static_cast<real>(bound * (2 * stream_.uniform(counter_++) - 1)); }

 private:
  RandomStream stream_;
  std::uint64_t counter_ = 0;
  bool zeros_ = false;
};

/// How a parameter lies in memory against how PyTorch names its axes (the layout of our checkpoints).
enum class Layout {
  plain,           ///< the same: biases
  linear,          ///< memory [in,out], file [out,in]
  pointwise,       ///< memory [in,out], file [out,in,1,1]: a 1x1 convolution
  conv,            ///< memory [k...,in,out], file [out,in,k...]
  conv_transpose,  ///< memory [k...,in,out], file [in,out,k...]
};

struct Parameter {
  std::string name;  ///< "upsampler.rirb.0.up.weight"
  Variable value;    ///< a handle: writing to its value changes the layer
  Layout layout = Layout::plain;
};

class Module {
 public:
  Module() = default;
  Module(const Module&) = default;
  Module(Module&&) = default;
  /// In the order of construction, which is the order in checkpoints.
  const std::vector<Parameter>& parameters() const { return parameters_; }
  Dim parameter_count() const;

 protected:
  ~Module() = default;  // not virtual: a layer is never deleted as a mere Module
  Variable add_parameter(const std::string& name, Tensor value, Layout layout);
  /// Adds the parameters of a part of this module to the list, as "name.its_name", and returns the part:
  ///   fc_(add("fc", Linear(in, out, rng)))
  template <class Part>
  Part add(const std::string& name, Part part) {
    add_parameters(name, part);
    return part;
  }
  /// The same of `count` parts, "name.0", "name.1" ...; make(i) is the i-th.
  template <class Make>
  auto add_each(const std::string& name, Dim count, Make make) {
    std::vector<decltype(make(Dim{}))> parts;
    for (Dim i = 0; i < count; ++i) parts.push_back(add(name + "." + std::to_string(i), make(i)));
    return parts;
  }

 private:
  void add_parameters(const std::string& name, const Module& part);

  std::vector<Parameter> parameters_;
};

/// The handles alone, for an optimiser.
std::vector<Variable> values_of(const std::vector<Parameter>& parameters);

/// Uniform in [-1/sqrt(fan_in), 1/sqrt(fan_in)): what PyTorch draws for convolutions and linear layers
/// (He et al. 2015 with a = sqrt(5)). Throws std::invalid_argument when fan_in < 1: a layer without inputs or
/// with a kernel of 0.
Tensor uniform_fan_in(const Shape& shape, Dim fan_in, Rng& rng);

}  // namespace supertac
