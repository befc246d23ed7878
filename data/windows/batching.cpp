#include "data/windows/batching.h"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <string>
#include <utility>

#include "io/numbers/hash.h"
#include "io/numbers/random.h"
#include "io/numbers/text.h"

namespace supertac {

EpochOrder::EpochOrder(std::uint64_t count, std::uint64_t seed, std::uint64_t epoch) : count_(count) {
  if (count < 1 || count > std::uint64_t{1} << 32)
    throw std::invalid_argument(refusal("epoch order", "count", "1 to 2^32", std::to_string(count)));
  half_bits_ = std::max(1, (static_cast<int>(std::bit_width(count - 1)) + 1) / 2);
  const RandomStream random(seed, (stream_named("ord") << 40) ^ epoch);
  for (std::uint64_t r = 0; r < kRounds; ++r)
    keys_[r] = (std::uint64_t{random.bits(2 * r)} << 32) | random.bits(2 * r + 1);
}

std::uint64_t EpochOrder::permute(std::uint64_t value) const {
  const std::uint64_t mask = (std::uint64_t{1} << half_bits_) - 1;
  std::uint64_t left = value >> half_bits_, right = value & mask;
  for (const std::uint64_t key : keys_) {
    left ^= mix64(key + right * kGolden64) & mask;
    std::swap(left, right);
  }
  return (left << half_bits_) | right;
}

std::uint64_t EpochOrder::operator[](std::uint64_t i) const {
  if (i >= count_)
    throw std::invalid_argument(
        refusal("epoch order", "index", "a number below " + std::to_string(count_), std::to_string(i)));
  do {
    i = permute(i);
  } while (i >= count_);
  return i;
}

Batching::Batching(std::vector<std::uint32_t> indices, std::size_t batch, std::uint64_t seed)
    : indices_(std::move(indices)), batch_(batch), seed_(seed) {
  if (indices_.empty())
    throw std::invalid_argument(refusal("batching", "windows", "one to train on, or more", "none"));
  if (batch < 1) throw std::invalid_argument(refusal("batching", "batch", "1 or more", "0"));
  batch_ = std::min(batch_, indices_.size());
}

void Batching::batch(std::uint64_t step, std::span<std::uint32_t> out) const {
  if (out.size() != batch_)
    throw std::invalid_argument(
        refusal("batching", "out", std::to_string(batch_) + " windows", std::to_string(out.size())));
  const EpochOrder order(indices_.size(), seed_, step / batches_per_epoch());
  const std::uint64_t first = step % batches_per_epoch() * batch_;
  for (std::size_t i = 0; i < batch_; ++i) out[i] = indices_[order[first + i]];
}

}  // namespace supertac
