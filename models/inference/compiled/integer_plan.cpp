#include "models/inference/compiled/integer_plan.h"

#include <string.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

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

// The functions of kernels.c, with the maps and all else that a step gives them.
using Function = void (*)(const c99::map* const* maps, const IntegerStep& step);
static const std::map<std::string, Function> kFunctions{
    {"take_input",
     [](const c99::map* const* maps, const IntegerStep& s) {
       const std::vector<std::int32_t>& n = s.numbers;
       c99::take_input(c99::input, maps[0], n[0], n[1], n[2], n[3], n[4], n[5], n[6]);
     }},
    {"to_bytes",
     [](const auto* maps, const IntegerStep& s) {
       c99::to_bytes(maps[0], maps[1], s.numbers[0], s.numbers[1], s.numbers[2]);
     }},
    {"product_of_bytes",
     [](const auto* maps, const IntegerStep& s) { c99::product_of_bytes(&s.product, maps[0], maps[1]); }},
    {"product_of_numbers",
     [](const auto* maps, const IntegerStep& s) { c99::product_of_numbers(&s.product, maps[0], maps[1]); }},
    {"copy", [](const auto* maps, const IntegerStep& s) { c99::copy(maps[0], maps[1], s.numbers[0]); }},
    {"mean", [](const auto* maps, const IntegerStep&) { c99::mean(maps[0], maps[1]); }},
    {"gates", [](const auto* maps, const IntegerStep&) { c99::gates(maps[0], maps[1]); }},
    {"gated_sum",
     [](const auto* maps, const IntegerStep&) { c99::gated_sum(maps[0], maps[1], maps[2], maps[3]); }}};

float IntegerPlan::number_step() const { return std::ldexp(1.0F, -fraction_bits); }

void IntegerPlan::run(const Tensor& inputs, Estimate& out) const {
  const Dim count = inputs.dim(0), size = count == 0 ? 0 : inputs.size() / count;
  Tensor memory(Shape{work_area / static_cast<Dim>(sizeof(real)) + 1});
  c99::work = reinterpret_cast<std::uint8_t*>(memory.data());
  c99::number_step = number_step();
  for (Dim n = 0; n < count; ++n) {
    const auto give = [&](int i, Tensor& to) {
      if (i >= 0) c99::give(&map(i), to.data() + n * (to.size() / count));
    };
    c99::input = inputs.data() + n * size;
    for (const IntegerStep& step : steps) {
      std::array<const c99::map*, 4> given{};
      std::ranges::transform(step.maps, given.begin(), [&](int i) { return i < 0 ? nullptr : &map(i); });
      if (step.writes_margin) c99::fill_margin(&map(step.maps.back()));
      kFunctions.at(step.function)(given.data(), step);
    }
    give(picture, out.picture);
    give(predicted_error, out.predicted_error);
    give(latents, out.latents);
  }
}

}  // namespace supertac
