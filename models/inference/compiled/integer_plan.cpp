#include "models/inference/compiled/integer_plan.h"

#include <string.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

namespace supertac {

// kernels.c, compiled for this machine. What is constant in a microcontroller's program is the thread's here.
namespace c99 {

static thread_local std::uint8_t* work = nullptr;
static thread_local float number_step = 1;
static thread_local const float* input = nullptr;

#define WORK work
#define NUMBER_STEP number_step
#include "models/inference/compiled/kernels.c"
#undef WORK
#undef NUMBER_STEP

}  // namespace c99

// A step with what its function is given.
struct IntegerCall {
  void (*function)(const IntegerCall&) = nullptr;
  const c99::map* margin = nullptr;  // to be filled before
  std::vector<c99::outcome> outcomes = {};
  c99::product product = {};
  std::array<const c99::map*, 4> maps = {};
  std::array<std::int32_t, 7> numbers = {};
};

namespace {

template <class Whole>
Whole narrow(Dim value) {
  const auto whole = static_cast<Whole>(value);
  if (static_cast<Dim>(whole) == value) return whole;
  throw std::runtime_error("int8: a layer has a size or a distance of " + std::to_string(value) +
                           ", expected at most " + std::to_string(std::numeric_limits<Whole>::max()) +
                           "; train a network of fewer channels, or for a smaller array");
}

c99::map c99_map(const IntegerMap& m) {
  return {.offset = narrow<std::int32_t>(m.offset),
          .height = narrow<std::int16_t>(m.height),
          .width = narrow<std::int16_t>(m.width),
          .channels = narrow<std::int16_t>(m.channels),
          .margin_h = narrow<std::int16_t>(m.margin_h),
          .margin_w = narrow<std::int16_t>(m.margin_w),
          .bytes = m.bytes,
          .zero = static_cast<std::uint8_t>(m.bytes ? m.scale.zero : 0)};
}

std::vector<c99::outcome> outcomes(const QuantisedProduct& q) {
  std::vector<c99::outcome> all;
  for (std::size_t o = 0; o < q.offset.size(); ++o)
    all.push_back({q.offset[o], narrow<std::uint16_t>(q.multiplier[o]), narrow<std::uint16_t>(q.shift[o])});
  return all;
}

c99::product c99_product(const IntegerStep& s, const std::vector<c99::outcome>& outcomes) {
  const ProductTaps& t = s.taps;
  c99::product p{.weights = s.packed.data(),
                 .outcomes = outcomes.data(),
                 .height = narrow<std::int16_t>(t.height),
                 .width = narrow<std::int16_t>(t.width),
                 .outputs = narrow<std::int16_t>(s.weights.outputs),
                 .length = narrow<std::int16_t>(t.length),
                 .segments = narrow<std::int16_t>(static_cast<Dim>(t.segments.size())),
                 .slope = narrow<std::int16_t>(s.negative_slope),
                 .x_line = narrow<std::int32_t>(t.from.line),
                 .x_pixel = narrow<std::int32_t>(t.from.pixel),
                 .y_line = narrow<std::int32_t>(t.to.line),
                 .y_pixel = narrow<std::int32_t>(t.to.pixel),
                 .y_first = narrow<std::int32_t>(t.y_offset),
                 .segment = {}};
  if (t.segments.size() > std::size(p.segment))
    throw std::runtime_error("int8: a kernel of over four rows is not supported");
  std::ranges::transform(t.segments, p.segment, [](Dim at) { return narrow<std::int32_t>(at); });
  return p;
}

const std::map<std::string, decltype(IntegerCall::function)> kFunctions{
    {"take_input",
     [](const IntegerCall& c) {
       const auto& [first, run, apart, step, multiplier, offset, shift] = c.numbers;
       c99::take_input(c99::input, c.maps[0], first, run, apart, step, multiplier, offset, shift);
     }},
    {"to_bytes",
     [](const IntegerCall& c) {
       c99::to_bytes(c.maps[0], c.maps[1], c.numbers[0], c.numbers[1], c.numbers[2]);
     }},
    {"product_of_bytes",
     [](const IntegerCall& c) { c99::product_of_bytes(&c.product, c.maps[0], c.maps[1]); }},
    {"product_of_numbers",
     [](const IntegerCall& c) { c99::product_of_numbers(&c.product, c.maps[0], c.maps[1]); }},
    {"copy", [](const IntegerCall& c) { c99::copy(c.maps[0], c.maps[1], c.numbers[0]); }},
    {"mean", [](const IntegerCall& c) { c99::mean(c.maps[0], c.maps[1]); }},
    {"gates", [](const IntegerCall& c) { c99::gates(c.maps[0], c.maps[1]); }},
    {"gated_sum", [](const IntegerCall& c) { c99::gated_sum(c.maps[0], c.maps[1], c.maps[2], c.maps[3]); }}};

}  // namespace

struct IntegerPlan::Compiled {
  std::vector<c99::map> maps;
  std::vector<IntegerCall> calls;

  const c99::map* map(int i) const { return i < 0 ? nullptr : &maps[static_cast<std::size_t>(i)]; }
};

void IntegerPlan::compile() {
  auto all = std::make_shared<Compiled>();
  for (const IntegerMap& m : maps) all->maps.push_back(c99_map(m));
  for (const IntegerStep& s : steps) {
    IntegerCall& call = all->calls.emplace_back(IntegerCall{.function = kFunctions.at(s.function)});
    if (s.writes_margin) call.margin = all->map(s.maps.back());
    call.outcomes = outcomes(s.weights);
    call.product = c99_product(s, call.outcomes);
    std::ranges::transform(s.maps, call.maps.begin(), [&](int m) { return all->map(m); });
    std::ranges::copy(s.numbers, call.numbers.begin());
  }
  compiled_ = all;
}

float IntegerPlan::number_step() const { return std::ldexp(1.0F, -fraction_bits); }

void IntegerPlan::run(const Tensor& inputs, Estimate& out) const {
  const Dim count = inputs.dim(0), size = count == 0 ? 0 : inputs.size() / count;
  Tensor memory(Shape{work_area / static_cast<Dim>(sizeof(real)) + 1});
  c99::work = reinterpret_cast<std::uint8_t*>(memory.data());
  c99::number_step = number_step();
  const Compiled& all = *compiled_;
  for (Dim n = 0; n < count; ++n) {
    const auto give = [&](int i, Tensor& to) {
      if (i >= 0) c99::give(all.map(i), to.data() + n * (to.size() / count));
    };
    c99::input = inputs.data() + n * size;
    for (const IntegerCall& call : all.calls) {
      if (call.margin != nullptr) c99::fill_margin(call.margin);
      call.function(call);
    }
    give(picture, out.picture);
    give(predicted_error, out.predicted_error);
    give(latents, out.latents);
  }
}

}  // namespace supertac
