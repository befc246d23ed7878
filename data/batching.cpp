#include "data/batching.h"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <string>
#include <utility>

#include "data/hash.h"
#include "io/random.h"

namespace supertac {
namespace {

constexpr uint64_t kOrderStream = 0x6f7264ULL << 40;

}  // namespace

EpochOrder::EpochOrder(uint64_t count, uint64_t seed, uint64_t epoch) : count_(count) {
  if (count < 1 || count > uint64_t{1} << 32)
    throw std::invalid_argument("epoch order: count must be 1 to 2^32, got " + std::to_string(count));
  half_bits_ = std::max(1, (static_cast<int>(std::bit_width(count - 1)) + 1) / 2);
  const RandomStream random(seed, kOrderStream ^ epoch);
  for (uint64_t r = 0; r < kRounds; ++r)
    keys_[r] = (uint64_t{random.bits(2 * r)} << 32) | random.bits(2 * r + 1);
}

uint64_t EpochOrder::permute(uint64_t value) const {
  const uint64_t mask = (uint64_t{1} << half_bits_) - 1;
  uint64_t left = value >> half_bits_, right = value & mask;
  for (const uint64_t key : keys_) {
    left ^= mix64(key + right * kGolden64) & mask;
    std::swap(left, right);
  }
  return (left << half_bits_) | right;
}

uint64_t EpochOrder::operator[](uint64_t i) const {
  if (i >= count_)
    throw std::invalid_argument("epoch order: index " + std::to_string(i) + " is not below " +
                                std::to_string(count_));
  do {
    i = permute(i);
  } while (i >= count_);
  return i;
}

Batching::Batching(std::vector<uint32_t> indices, size_t batch, uint64_t seed)
    : indices_(std::move(indices)), batch_(batch), seed_(seed) {
  if (indices_.empty()) throw std::invalid_argument("batching: there is no window to train on");
  if (batch < 1) throw std::invalid_argument("batching: the batch size must be at least 1, got 0");
  batch_ = std::min(batch_, indices_.size());
}

void Batching::batch(uint64_t epoch, uint64_t b, std::span<uint32_t> out) const {
  if (b >= batches_per_epoch() || out.size() != batch_)
    throw std::invalid_argument("batching: batch " + std::to_string(b) + " of " +
                                std::to_string(batches_per_epoch()) + " into " + std::to_string(out.size()) +
                                " places; a batch has " + std::to_string(batch_) + " windows");
  const EpochOrder order(indices_.size(), seed_, epoch);
  for (size_t i = 0; i < batch_; ++i) out[i] = indices_[order[b * batch_ + i]];
}

}  // namespace supertac
