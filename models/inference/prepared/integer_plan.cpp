#include "models/inference/prepared/integer_plan.h"

#include <algorithm>
#include <cmath>

#include "autograd/kernels/fast/int8/numbers.h"

namespace supertac {
namespace {

constexpr Dim kBlock = 4;  // images that go through the steps together

struct Memory {
  const IntegerPlan& plan;
  const real* input;
  Dim images;
  std::uint8_t *scratch, *work;

  // Of all images of a map, one behind the other.
  std::uint8_t* begin(const IntegerMap& map) const { return work + map.offset * images; }
  std::int16_t* numbers(const IntegerMap& map) const {
    return reinterpret_cast<std::int16_t*>(begin(map)) + map.origin();
  }
  std::uint8_t* bytes(const IntegerMap& map) const { return begin(map) + map.origin(); }
};

void fill_margin(const IntegerMap& map, const Memory& m) {
  if (map.bytes) return fill_margin(map, m.images, static_cast<std::uint8_t>(map.scale.zero), m.begin(map));
  fill_margin(map, m.images, std::int16_t{0}, reinterpret_cast<std::int16_t*>(m.begin(map)));
}

void take_runs(const InputRuns& s, const IntegerMap& y, const real* input, real* out) {
  for (Dim pixel = 0; pixel < y.height * y.width; ++pixel, input += s.step)
    for (Dim k = 0; k < y.channels; k += s.run)
      out = std::copy_n(input + s.first + k / s.run * s.apart, s.run, out);
}

void run_input(const IntegerStep& s, const Memory& m) {
  const IntegerMap& y = m.plan.map(s.y);
  const Dim pixels = y.height * y.width, row = y.width * y.channels;
  auto* const values = reinterpret_cast<real*>(m.scratch);
  auto* const numbers = reinterpret_cast<std::int16_t*>(values + pixels * y.channels);
  for (Dim n = 0; n < m.images; ++n) {
    take_runs(s.runs, y, m.input + n * m.plan.input_size, values);
    kernels::to_numbers(pixels * y.channels, values, 1 / m.plan.number_step(), numbers);
    for (Dim line = 0; line < y.height; ++line) {
      const Dim at = n * y.image() + line * y.line();
      if (y.bytes)
        kernels::to_bytes(row, numbers + line * row, s.scale.multiplier, s.scale.offset, s.scale.shift,
                          y.scale.zero, m.bytes(y) + at);
      else
        std::copy_n(numbers + line * row, row, m.numbers(y) + at);
    }
  }
}

void run_product(const IntegerStep& s, const IntegerMap& x, const IntegerMap& y, const Memory& m) {
  kernels::ByteProductJob job = s.job;
  job.images = m.images;
  job.segments = s.segments.data(), job.segment_count = static_cast<Dim>(s.segments.size());
  job.outcome.multiplier = s.weights.multiplier.data();
  job.outcome.offset = s.weights.offset.data(), job.outcome.shift = s.weights.shift.data();
  job.places = s.places.data(), job.place_count = static_cast<Dim>(s.places.size());
  job.scratch = reinterpret_cast<std::int16_t*>(m.scratch);
  if (!x.bytes) {
    job.w = s.weights.w.data();
    return kernels::product_of_numbers(job, m.numbers(x), m.numbers(y) + s.y_offset);
  }
  job.w = reinterpret_cast<const std::int8_t*>(s.packed.data());
  kernels::byte_kernels().product(job, m.bytes(x), y.bytes ? nullptr : m.numbers(y) + s.y_offset,
                                  y.bytes ? m.bytes(y) + s.y_offset : nullptr);
}

void run_copy(const IntegerStep& s, const IntegerMap& x, const IntegerMap& y, const Memory& m) {
  const Dim run = std::min(x.channels, y.width * y.channels);
  for (Dim n = 0; n < m.images; ++n)
    for (Dim line = 0; line < y.height; ++line)
      std::copy_n(m.numbers(x) + n * x.image() + line * run, run,
                  m.numbers(y) + n * y.image() + line * y.line() + s.at);
}

void run_mean(const IntegerMap& x, const IntegerMap& y, const Memory& m) {
  for (Dim n = 0; n < m.images; ++n)
    kernels::means(x.height, x.width, x.channels, x.line(), m.numbers(x) + n * x.image(),
                   m.numbers(y) + n * y.image());
}

void run_lines(const IntegerStep& s, const IntegerMap& x, const IntegerMap& y, const Memory& m) {
  for (Dim n = 0; n < m.images; ++n)
    for (Dim line = 0; line < x.height; ++line) {
      const auto at = [&](const IntegerMap& of) { return n * of.image() + line * of.line(); };
      if (s.kind == IntegerStep::Kind::to_bytes)
        kernels::to_bytes(x.width * x.channels, m.numbers(x) + at(x), s.scale.multiplier, s.scale.offset,
                          s.scale.shift, y.scale.zero, m.bytes(y) + at(y));
      else
        kernels::gated_sum(
            x.width, x.channels, m.numbers(m.plan.map(s.a)) + at(m.plan.map(s.a)), m.numbers(x) + at(x),
            s.gates < 0 ? nullptr : m.numbers(m.plan.map(s.gates)) + n * m.plan.map(s.gates).image(),
            m.numbers(y) + at(y));
    }
}

void run_step(const IntegerStep& s, const Memory& m) {
  using Kind = IntegerStep::Kind;
  const IntegerMap& y = m.plan.map(s.y);
  if (s.writes_margin) fill_margin(y, m);
  if (s.kind == Kind::input) return run_input(s, m);
  const IntegerMap& x = m.plan.map(s.x);
  switch (s.kind) {
    case Kind::product:
      return run_product(s, x, y, m);
    case Kind::copy:
      return run_copy(s, x, y, m);
    case Kind::mean:
      return run_mean(x, y, m);
    case Kind::gates:
      return kernels::gates(m.images * x.image(), m.numbers(x), m.plan.number_step(), m.numbers(y));
    default:
      return run_lines(s, x, y, m);
  }
}

void copy_out(const Memory& m, int of, Dim first, Tensor& to) {
  const IntegerMap& map = m.plan.map(of);
  real* target = to.data() + first * map.height * map.width * map.channels;
  for (Dim n = 0; n < m.images; ++n)
    for (Dim line = 0; line < map.height; ++line)
      for (Dim i = 0; i < map.width * map.channels; ++i) {
        const Dim at = n * map.image() + line * map.line() + i;
        *target++ = map.bytes ? static_cast<real>(map.scale.step * (m.bytes(map)[at] - map.scale.zero))
                              : static_cast<real>(m.numbers(map)[at]) * m.plan.number_step();
      }
}

void show(const StepWatch& watch, const Memory& m, const IntegerStep& step) {
  const IntegerMap& y = m.plan.map(step.y);
  Tensor map(Shape{y.height, y.width, y.channels});
  copy_out(m, step.y, 0, map);
  if (step.kind == IntegerStep::Kind::gates)  // in 4096ths
    for (real& gate : map.values()) gate *= 1 / (4096 * m.plan.number_step());
  watch(step.name, map);
}

}  // namespace

float IntegerPlan::number_step() const { return std::ldexp(1.0F, -fraction_bits); }

Estimate IntegerPlan::run(const Tensor& inputs, const StepWatch* watch) const {
  const Dim count = inputs.dim(0), size = count == 0 ? 0 : inputs.size() / count;
  Estimate out;
  out.picture = Tensor(Shape{count, map(picture).height, map(picture).width, 1});
  if (predicted_error >= 0) out.predicted_error = Tensor(out.picture.shape());
  if (latents >= 0) out.latents = Tensor(Shape{count, map(latents).channels});
  const Dim bytes = scratch + work_area * std::min(count, kBlock);
  Tensor memory(Shape{bytes / static_cast<Dim>(sizeof(real)) + 1});
  auto* const begin = reinterpret_cast<std::uint8_t*>(memory.data());
  const kernels::ByteProducts products;  // of tiles, for which a process asks the system
  for (Dim first = 0; first < count; first += kBlock) {
    const Memory block{*this, inputs.data() + first * size, std::min(kBlock, count - first), begin,
                       begin + scratch};
    for (std::size_t i = 0; i < steps.size(); ++i) {
      run_step(steps[i], block);
      const bool complete =
          i + 1 == steps.size() || steps[i + 1].y != steps[i].y;  // by several steps at times
      if (watch != nullptr && complete) show(*watch, block, steps[i]);
    }
    copy_out(block, picture, first, out.picture);
    if (predicted_error >= 0) copy_out(block, predicted_error, first, out.predicted_error);
    if (latents >= 0) copy_out(block, latents, first, out.latents);
  }
  return out;
}

}  // namespace supertac
