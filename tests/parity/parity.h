// Reads what make_parity.py has written, and measures how far a result is from it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "autograd/record.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "layers/checkpoint.h"

namespace supertac::test {

/// make_parity.py's counter_numbers: the parameters, inputs and weights that both sides compute.
inline std::vector<double> counter_numbers(const std::string& name, std::size_t count, double bound = 1) {
  std::uint64_t key = 0xCBF29CE484222325U;
  for (const char c : name) key = (key ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t z = mix64(key + (i + 1) * kGolden64);
    values[i] = bound * (static_cast<double>(z >> 40) * 0x1p-23 - 1);
  }
  return values;
}

/// Where element i of the file's order of a parameter lies in memory.
inline std::vector<std::size_t> places(const Shape& shape, Layout layout) {
  Tensor numbered(shape);
  std::iota(numbered.values().begin(), numbered.values().end(), real(0));
  const std::vector<float> order = to_stored({"", Variable(numbered), layout}).values;
  return {order.begin(), order.end()};
}

/// A stored array of either type.
inline std::vector<double> stored(const SafetensorsFile& file, const std::string& name) {
  if (file.tensors().at(name).dtype == "F64") return file.f64(name);
  const std::vector<float> values = file.f32(name);
  return {values.begin(), values.end()};
}

/// Two ways to look at the largest difference from the reference.
struct Difference {
  /// |a - b| / max(|b|, 1e-3 max|b|): small entries count by their own size, down to a thousandth of the
  /// largest. Rounding in fp32 is about 1e-7 of the largest term of a sum, so only double precision can
  /// promise 1e-5 here.
  double by_entry = 0;
  /// |a - b| / max|b|: what fp32 can promise.
  double by_tensor = 0;
  std::string worst;  ///< the entry that differs most by its own size, and both its values
};

inline Difference difference(std::span<const double> found, std::span<const double> expected) {
  double largest = 0;
  for (const double b : expected) largest = std::max(largest, std::abs(b));
  Difference d;
  if (found.size() != expected.size()) return {1e30, 1e30, "another number of entries"};
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double error = std::abs(found[i] - expected[i]);
    const double floor = std::max({std::abs(expected[i]), 1e-3 * largest, 1e-30});
    const double by_entry = std::isfinite(error) ? error / floor : 1e30;
    if (by_entry > d.by_entry || d.worst.empty())
      d.worst = "entry " + std::to_string(i) + ": found " + digits(found[i], 12) + ", expected " +
                digits(expected[i], 12);
    d.by_entry = std::max(d.by_entry, by_entry);
    d.by_tensor = std::isfinite(error) ? std::max(d.by_tensor, error / std::max(largest, 1e-30)) : 1e30;
  }
  return d;
}

inline std::vector<double> doubles(const Tensor& t) { return {t.values().begin(), t.values().end()}; }

}  // namespace supertac::test
