// From what an inference was seen to do (autograd/trace.h) to the steps of
// models/inference/compiled/integer_plan.h.
//
// A value lies in memory as bytes, as numbers (int16) or as both, by who reads it:
//
//   input -> bytes -> product -> bytes -> product -> numbers -> mean, gates, gated sum -> numbers -> product
//                                                        `-> bytes (to_bytes), where a product reads them
//
// `numbers_` and `bytes_` give the maps of a value. A map is placed in the first gap of the work area between
// maps that are still read (`live_`), and is free behind the last op that reads it.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <stdexcept>

#include "models/inference/compiled/integer_plan.h"
#include "models/inference/compiled/taps.h"

namespace supertac {
namespace {

constexpr int kMultiplierBits = 6, kLeastShift = 6, kMostShift = 29;
constexpr double kLargestWeight = 127, kMostSum = 1 << 30, kMostOffset = 1 << 29;

// As kernels.c counts it.
template <class Whole>
Whole narrow(Dim value) {
  const auto whole = static_cast<Whole>(value);
  if (static_cast<Dim>(whole) == value) return whole;
  throw std::runtime_error("int8: a layer has a size or a distance of " + std::to_string(value) +
                           ", expected at most " + std::to_string(std::numeric_limits<Whole>::max()) +
                           "; train a network of fewer channels, or for a smaller array");
}

// A map, whose offset is in bytes and whose margin has the value that stands for 0, in memory that is reused
// behind the last step that reads it. Either bytes, each map with a scale of its own, or numbers of 16 bits
// in steps of 2^-fraction_bits, for what bytes would be too coarse for: sums of residual blocks, latents, the
// picture.
struct IntegerMap : FeatureMap {
  bool bytes = false;
  Scale scale;

  Dim size() const { return image() * (bytes ? 1 : 2); }  // bytes
  c99::map c99() const {
    return {.offset = narrow<std::int32_t>(offset),
            .height = narrow<std::int16_t>(height),
            .width = narrow<std::int16_t>(width),
            .channels = narrow<std::int16_t>(channels),
            .margin_h = narrow<std::int16_t>(margin_h),
            .margin_w = narrow<std::int16_t>(margin_w),
            .bytes = bytes,
            .zero = static_cast<std::uint8_t>(bytes ? scale.zero : 0)};
  }
};

// Sums of a product: s[o] = sum over k of x[k] * w[k, o], where x are whole numbers of scale `from`, become
//   v[o] = (s[o] * multiplier[o] + offset[o]) >> shift[o]
// in steps of `to`, zero not yet added. A weight's step is chosen so that multiplier / 2^shift is exact:
//   w = q * step_w[o],   step_w[o] = multiplier[o] / 2^shift[o] * to.step / from.step,   |q| <= 127
// The multiplier has six bits, so that for sums of bytes nothing overflows 32 bits, in vectors or on a
// microcontroller; of sums of 16-bit numbers the product takes 64.
struct QuantisedProduct {
  std::vector<std::int8_t> w;  // [rows][outputs]
  std::vector<c99::outcome> outcomes;
};

// The smallest multiplier / 2^shift that is no less than `target`, as fine as the bits allow.
struct Factor {
  std::int32_t multiplier, shift;
  double value() const { return std::ldexp(multiplier, -shift); }
};

Factor factor_of(double target, double bias_steps) {
  int exponent = 0, room = 0;
  std::frexp(target, &exponent);
  std::frexp(bias_steps, &room);  // the bias is shifted too
  const int most = std::clamp(kMostShift - 1 - room, kLeastShift, kMostShift);
  const int shift = std::clamp(kMultiplierBits - exponent, kLeastShift, most);
  const double multiplier = std::clamp(std::ceil(std::ldexp(target, shift)), 1.0, 1048576.0);
  return {static_cast<std::int32_t>(multiplier), shift};
}

// w [rows][outputs], bias [outputs].
QuantisedProduct quantise(Dim rows, std::span<const real> w, std::span<const real> bias, const Scale& from,
                          const Scale& to) {
  const auto count = static_cast<std::size_t>(rows), outputs = bias.size();
  QuantisedProduct q{std::vector<std::int8_t>(w.size()), {}};
  for (std::size_t o = 0; o < outputs; ++o) {
    double largest = 0;
    for (std::size_t k = 0; k < count; ++k)
      largest = std::max(largest, std::abs(static_cast<double>(w[k * outputs + o])));
    const double bias_steps = static_cast<double>(bias[o]) / to.step;
    Factor factor = factor_of(largest / kLargestWeight * from.step / to.step, bias_steps);
    double sum = 0;
    for (bool fits = false; !fits;) {
      const double step = factor.value() * to.step / from.step;
      double magnitude = 0;
      sum = 0;
      for (std::size_t k = 0; k < count; ++k) {
        const double whole = std::clamp(std::rint(static_cast<double>(w[k * outputs + o]) / step),
                                        -kLargestWeight, kLargestWeight);
        q.w[k * outputs + o] = static_cast<std::int8_t>(whole);
        sum += whole, magnitude += std::abs(whole);
      }
      const double most = magnitude * from.largest;
      fits = from.largest > 255 ? most < 2 * kMostSum : most * factor.multiplier <= kMostSum;
      if (fits || factor.multiplier == 1) break;
      factor = factor.shift > kLeastShift ? Factor{(factor.multiplier + 1) / 2, factor.shift - 1}
                                          : Factor{factor.multiplier / 2, factor.shift};
    }
    const double scaled = std::clamp(std::ldexp(bias_steps, factor.shift), -kMostOffset, kMostOffset),
                 offset = std::rint(scaled - sum * from.zero * factor.multiplier);
    q.outcomes.push_back({(1 << (factor.shift - 1)) + static_cast<std::int32_t>(offset),
                          narrow<std::uint16_t>(factor.multiplier), narrow<std::uint16_t>(factor.shift)});
  }
  return q;
}

// {multiplier, offset, shift}
std::vector<std::int32_t> requantise(double from_step, double to_step) {
  constexpr int kBits = 14;
  const double target = from_step / to_step;
  int exponent = 0;
  std::frexp(target, &exponent);
  const int shift = std::clamp(kBits - exponent, 1, kMostShift);
  const double multiplier = std::clamp(std::rint(std::ldexp(target, shift)), 0.0, 32767.0);
  return {static_cast<std::int32_t>(multiplier), 1 << (shift - 1), shift};
}

constexpr Dim kFour = 4;  // bytes, and outputs, that kernels.c multiplies together

class IntegerCompiler : TraceWalk {
 public:
  IntegerCompiler(const SuperTac& network, const ActivationRanges& ranges, const TracedPrediction& traced);
  std::shared_ptr<IntegerPlan> plan() { return std::move(plan_); }

 private:
  void choose_fraction_bits(const std::vector<TracedOp>& ops, const ActivationRanges& ranges);
  void make(const TracedOp& op);
  void concat(const TracedOp& op, int y);
  void take_input(const TracedOp& op);

  bool is_of_bytes(const TracedOp& op) const;
  bool as_bytes(Id id) const { return read_as_bytes_.contains(id); }
  bool as_numbers(Id id) const { return read_as_numbers_.contains(id); }
  int new_map(const Variable& y, bool bytes);
  const IntegerMap& map(int i) const { return maps_[static_cast<std::size_t>(i)]; }
  int numbers_of(const Variable& x) const { return numbers_.at(owner(x)); }
  IntegerStep& add(std::string function, std::string name, std::vector<int> maps,
                   std::vector<std::int32_t> numbers = {});
  void add_product(const TracedOp& op, int x, int y, const ProductTaps& taps);
  void add_bytes(const Variable& y);
  void release(std::size_t op);
  std::string layer_of(const TracedOp& op) const;

  std::shared_ptr<IntegerPlan> plan_ = std::make_shared<IntegerPlan>();
  std::vector<IntegerMap> maps_;      // of the plan
  std::map<Id, std::string> layers_;  // by weight
  std::map<Id, Scale> scales_;        // as bytes
  std::set<Id> read_as_bytes_, read_as_numbers_;
  std::map<Id, int> numbers_, bytes_;
  std::map<int, Id> live_;  // maps that are still read, and their values
  std::set<int> written_;
};

IntegerCompiler::IntegerCompiler(const SuperTac& network, const ActivationRanges& ranges,
                                 const TracedPrediction& traced)
    : TraceWalk(traced) {
  const std::vector<TracedOp>& ops = traced.trace.ops();
  const Prediction& drawn = traced.drawn;
  if (ranges.ops() != ops.size())
    refuse("CompiledModel", "ranges", "those of the network's " + std::to_string(ops.size()) + " ops",
           std::to_string(ranges.ops()));
  for (const Parameter& p : network.parameters())
    layers_[p.value.node()] = p.name.substr(0, p.name.rfind('.'));
  for (std::size_t i = 0; i < ops.size(); ++i) scales_[ops[i].y.node()] = ranges.scale(i);
  for (const TracedOp& op : ops) {
    if (op.op == "flatten_channels_first") continue;
    const bool of_bytes = is_of_bytes(op);
    for (const Variable& x : op.inputs) (of_bytes ? read_as_bytes_ : read_as_numbers_).insert(owner(x));
  }
  for (const Variable* y : {&drawn.picture, &drawn.predicted_error, &drawn.latents})
    if (y->defined()) read_as_numbers_.insert(owner(*y));
  choose_fraction_bits(ops, ranges);
  for (std::size_t i = 0; i < ops.size(); ++i) {
    make(ops[i]);
    release(i);
  }
  plan_->picture = numbers_of(drawn.picture);
  if (drawn.predicted_error.defined()) plan_->predicted_error = numbers_of(drawn.predicted_error);
  if (drawn.latents.defined()) plan_->latents = numbers_of(drawn.latents);
}

// Twice the largest number fits; sums of residual blocks may be larger than they were seen to be.
void IntegerCompiler::choose_fraction_bits(const std::vector<TracedOp>& ops, const ActivationRanges& ranges) {
  constexpr double kRoom = 16384;
  double largest = 1;
  for (std::size_t i = 0; i < ops.size(); ++i)
    if (as_numbers(ops[i].y.node())) largest = std::max(largest, ranges.largest(i));
  plan_->fraction_bits = static_cast<int>(std::clamp(std::floor(std::log2(kRoom / largest)), 0.0, 14.0));
}

// Where whole quads of channels meet enough outputs to repay the way into bytes and back. The picture's own
// convolution reads numbers: measured, rounding its input costs the most (bench/results).
bool IntegerCompiler::is_of_bytes(const TracedOp& op) const {
  if (!scales_.contains(owner(op.inputs[0]))) return false;
  if (op.op == "linear") return owner(op.inputs[0]) != op.inputs[0].node();
  return op.op.starts_with("conv") && op.inputs[0].dim(op.inputs[0].rank() - 1) % kFour == 0 &&
         op.y.dim(op.y.rank() - 1) > 1;
}

// In the first gap between the maps that are still read.
int IntegerCompiler::new_map(const Variable& y, bool bytes) {
  constexpr Dim kLine = 64;  // of the cache, in bytes
  IntegerMap m{layout_of(y), bytes, bytes ? scales_.at(y.node()) : Scale{plan_->number_step(), 0, 32768}};
  const auto rounded = [](Dim size) { return (size + kLine - 1) / kLine * kLine; };
  std::vector<std::pair<Dim, Dim>> taken;
  for (const auto& [i, value] : live_)
    taken.emplace_back(map(i).offset, map(i).offset + rounded(map(i).size()));
  std::ranges::sort(taken);
  for (const auto& [begin, end] : taken) {
    if (begin >= m.offset + rounded(m.size())) break;
    m.offset = std::max(m.offset, end);
  }
  plan_->work_area = std::max(plan_->work_area, m.offset + rounded(m.size()));
  maps_.push_back(m);
  plan_->maps.push_back(m.c99());
  const int index = static_cast<int>(maps_.size()) - 1;
  live_[index] = y.node();
  (bytes ? bytes_ : numbers_)[y.node()] = index;
  return index;
}

void IntegerCompiler::release(std::size_t op) {
  std::erase_if(live_, [&](const auto& live) { return !read_after(live.second, op); });
}

IntegerStep& IntegerCompiler::add(std::string function, std::string name, std::vector<int> maps,
                                  std::vector<std::int32_t> numbers) {
  const int y = maps.back();
  const bool writes_margin = written_.insert(y).second && map(y).margin_h + map(y).margin_w > 0;
  return plan_->steps.emplace_back(
      IntegerStep{std::move(function), std::move(name), std::move(maps), std::move(numbers), writes_margin});
}

std::string IntegerCompiler::layer_of(const TracedOp& op) const {
  const auto found = op.inputs.size() > 1 ? layers_.find(op.inputs[1].node()) : layers_.end();
  return found == layers_.end() ? std::string(op.op) : found->second;
}

void IntegerCompiler::make(const TracedOp& op) {
  if (op.op == "flatten_channels_first") return;  // the linear layer behind it takes the map as it is
  if (takes_input(op)) return take_input(op);
  const bool product = op.op.starts_with("conv") || op.op == "linear";
  if (product) {
    const bool bytes_in = is_of_bytes(op);
    // Sums of bytes become what is read; what is read as both, or sums of numbers, numbers first.
    const bool bytes_out = bytes_in && as_bytes(op.y.node()) && !as_numbers(op.y.node());
    const int x = bytes_in ? bytes_.at(owner(op.inputs[0])) : numbers_of(op.inputs[0]);
    const int y = new_map(op.y, bytes_out);
    for (const ProductTaps& taps : products_of(op, map(x), map(y))) add_product(op, x, y, taps);
    if (bytes_out) return;
  } else if (op.op == "unflatten_channels_first") {
    add("copy", "unflatten", {numbers_of(op.inputs[0]), new_map(op.y, false)}, {0});
  } else if (op.op == "concat") {
    concat(op, new_map(op.y, false));
  } else if (op.op == "global_mean") {
    add("mean", "mean over the pixels", {numbers_of(op.inputs[0]), new_map(op.y, false)});
  } else if (op.op == "sigmoid" && op.y.rank() == 2) {
    add("gates", "sigmoid", {numbers_of(op.inputs[0]), new_map(op.y, false)});
  } else if (op.op == "gated_sum" || op.op == "add") {
    const int gates = op.op == "add" ? -1 : numbers_of(op.inputs[2]);
    add("gated_sum", op.op == "add" ? "sum" : "gated sum",
        {numbers_of(op.inputs[0]), numbers_of(op.inputs[1]), gates, new_map(op.y, false)});
  } else {
    throw std::logic_error("CompiledModel: no step in whole numbers computes the op " + std::string(op.op));
  }
  add_bytes(op.y);
}

void IntegerCompiler::add_bytes(const Variable& y) {
  if (!as_bytes(y.node())) return;
  const int x = numbers_.at(y.node()), to = new_map(y, true);
  add("to_bytes", "to bytes", {x, to}, requantise(map(x).scale.step, map(to).scale.step));
}

void IntegerCompiler::take_input(const TracedOp& op) {
  const Variable& y = op.y;
  const bool bytes = as_bytes(y.node()) && !as_numbers(y.node());
  const int to = new_map(y, bytes);
  const InputRuns runs = InputRuns::of(op);
  std::vector<std::int32_t> numbers;
  for (const Dim number : {runs.first, runs.run, runs.apart, runs.step})
    numbers.push_back(static_cast<std::int32_t>(number));
  const std::vector<std::int32_t> scale =
      bytes ? requantise(plan_->number_step(), map(to).scale.step) : std::vector{1, 0, 0};
  numbers.insert(numbers.end(), scale.begin(), scale.end());
  add("take_input", "input", {to}, numbers);
  if (!bytes) add_bytes(y);
}

void IntegerCompiler::concat(const TracedOp& op, int y) {
  if (op.y.rank() > 2) throw std::logic_error("CompiledModel: a concat of maps has no step in whole numbers");
  std::int32_t at = 0;
  for (const Variable& input : op.inputs) {
    const int x = numbers_of(input);
    add("copy", "concat", {x, y}, {at});
    at += static_cast<std::int32_t>(map(x).channels);
  }
}

// w [rows][outputs] as kernels.c takes it (IntegerStep::weights).
std::vector<std::uint8_t> packed(const std::vector<std::int8_t>& w, Dim rows, Dim outputs, bool bytes) {
  const Dim run = bytes ? kFour : 1;
  std::vector<std::uint8_t> out;
  for (Dim first = 0; first < outputs; first += run)
    for (Dim begin = 0; begin < rows; begin += run)
      for (Dim o = first; o < first + run; ++o)
        for (Dim k = begin; k < begin + run; ++k) {
          const int weight = o < outputs ? w[static_cast<std::size_t>(k * outputs + o)] : 0;
          out.push_back(static_cast<std::uint8_t>(bytes ? weight + 128 : weight));
        }
  return out;
}

void IntegerCompiler::add_product(const TracedOp& op, int x, int y, const ProductTaps& t) {
  constexpr double kSlopes = IntegerStep::kNoSlope;
  const Dim slope = std::lrint(op.settings.negative_slope * kSlopes);
  if (slope != IntegerStep::kNoSlope && (slope < 0 || slope > 63))
    throw std::logic_error("CompiledModel: a negative slope of " +
                           std::to_string(op.settings.negative_slope) + " has no step in whole numbers");
  IntegerStep& s = add(map(x).bytes ? "product_of_bytes" : "product_of_numbers", layer_of(op), {x, y});
  const Dim outputs = t.bias.size(), rows = static_cast<Dim>(t.segments.size()) * t.length;
  QuantisedProduct q = quantise(rows, t.w.values(), t.bias.values(), map(x).scale, map(y).scale);
  s.outcomes = std::move(q.outcomes);
  s.weights = packed(q.w, rows, outputs, map(x).bytes);
  s.product = {.weights = s.weights.data(),
               .outcomes = s.outcomes.data(),
               .height = narrow<std::int16_t>(t.height),
               .width = narrow<std::int16_t>(t.width),
               .outputs = narrow<std::int16_t>(outputs),
               .length = narrow<std::int16_t>(t.length),
               .segments = narrow<std::int16_t>(std::ssize(t.segments)),
               .slope = narrow<std::int16_t>(slope),
               .x_line = narrow<std::int32_t>(t.from.line),
               .x_pixel = narrow<std::int32_t>(t.from.pixel),
               .y_line = narrow<std::int32_t>(t.to.line),
               .y_pixel = narrow<std::int32_t>(t.to.pixel),
               .y_first = narrow<std::int32_t>(t.y_offset),
               .segment = {}};
  if (t.segments.size() > std::size(s.product.segment))
    throw std::runtime_error("int8: a kernel of over four rows is not supported");
  std::ranges::transform(t.segments, s.product.segment, narrow<std::int32_t>);
}

}  // namespace

std::shared_ptr<const IntegerPlan> IntegerPlan::of(const SuperTac& network, const ActivationRanges& ranges) {
  const TracedPrediction traced(network, Tensor::zeros(network.input_shape(1)));
  return IntegerCompiler(network, ranges, traced).plan();
}

}  // namespace supertac
