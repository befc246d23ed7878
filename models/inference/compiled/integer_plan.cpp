#include "models/inference/compiled/integer_plan.h"

#include <string.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace supertac {

// kernels.c, compiled for this machine. What is constant in a microcontroller's program is the thread's here.
namespace c99 {

static thread_local std::uint8_t* work = nullptr;
static thread_local float number_step = 1;

#define WORK work
#define NUMBER_STEP number_step
#include "models/inference/compiled/kernels.c"
#undef WORK
#undef NUMBER_STEP

}  // namespace c99

struct IntegerPlan::Compiled {
  std::vector<c99::map> maps;
  std::vector<std::vector<c99::outcome>> outcomes;
  std::vector<c99::product> products;  // of each step; empty for those that are none

  const c99::map* map(int i) const { return i < 0 ? nullptr : &maps[static_cast<std::size_t>(i)]; }
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

c99::map compiled(const IntegerMap& m) {
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

c99::product compiled(const IntegerStep& s, const std::vector<c99::outcome>& outcomes) {
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

void run_step(const IntegerStep& s, const c99::product& product, const real* input, const c99::map* x,
              const c99::map* a, const c99::map* gate, const c99::map* y) {
  using Kind = IntegerStep::Kind;
  const auto& [multiplier, offset, shift] = s.scale;
  const auto whole = [](Dim value) { return static_cast<std::int32_t>(value); };
  if (s.writes_margin) c99::fill_margin(y);
  switch (s.kind) {
    case Kind::input:
      return c99::take_input(input, y, whole(s.runs.first), whole(s.runs.run), whole(s.runs.apart),
                             whole(s.runs.step), multiplier, offset, shift);
    case Kind::to_bytes:
      return c99::to_bytes(x, y, multiplier, offset, shift);
    case Kind::product:
      return x->bytes != 0 ? c99::product_of_bytes(&product, x, y) : c99::product_of_numbers(&product, x, y);
    case Kind::copy:
      return c99::copy(x, y, whole(s.at));
    case Kind::mean:
      return c99::mean(x, y);
    case Kind::gates:
      return c99::gates(x, y);
    case Kind::gated_sum:
      return c99::gated_sum(a, x, gate, y);
  }
}

}  // namespace

void IntegerPlan::compile() {
  auto all = std::make_shared<Compiled>();
  for (const IntegerMap& m : maps) all->maps.push_back(compiled(m));
  for (const IntegerStep& s : steps) all->outcomes.push_back(outcomes(s.weights));
  for (std::size_t i = 0; i < steps.size(); ++i)
    all->products.push_back(compiled(steps[i], all->outcomes[i]));
  compiled_ = all;
}

float IntegerPlan::number_step() const { return std::ldexp(1.0F, -fraction_bits); }

Estimate IntegerPlan::run(const Tensor& inputs) const {
  const Dim count = inputs.dim(0), size = count == 0 ? 0 : inputs.size() / count;
  Estimate out;
  out.picture = Tensor(Shape{count, map(picture).height, map(picture).width, 1});
  if (predicted_error >= 0) out.predicted_error = Tensor(out.picture.shape());
  if (latents >= 0) out.latents = Tensor(Shape{count, map(latents).channels});
  Tensor memory(Shape{work_area / static_cast<Dim>(sizeof(real)) + 1});
  c99::work = reinterpret_cast<std::uint8_t*>(memory.data());
  c99::number_step = number_step();
  const Compiled& all = *compiled_;
  for (Dim n = 0; n < count; ++n) {
    const auto give = [&](int i, Tensor& to) {
      if (i >= 0) c99::give(all.map(i), to.data() + n * (to.size() / count));
    };
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const IntegerStep& s = steps[i];
      run_step(s, all.products[i], inputs.data() + n * size, all.map(s.x), all.map(s.a), all.map(s.gates),
               all.map(s.y));
    }
    give(picture, out.picture);
    give(predicted_error, out.predicted_error);
    give(latents, out.latents);
  }
  return out;
}

}  // namespace supertac
