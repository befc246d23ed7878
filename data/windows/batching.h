// In which order an epoch of training takes its windows.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace supertac {

/// A random order of 0..count-1 that is computed, not stored: a four-round Feistel network on the next even
/// number of bits, walked until it falls below count (Black and Rogaway 2002). Its round function is a
/// counter-based random number of (seed, epoch). One call costs some tens of nanoseconds and no memory.
class EpochOrder {
 public:
  /// Throws std::invalid_argument when count is 0 or above 2^32.
  EpochOrder(std::uint64_t count, std::uint64_t seed, std::uint64_t epoch);
  /// Element i of the order. Throws std::invalid_argument unless i < count.
  std::uint64_t operator[](std::uint64_t i) const;

 private:
  static constexpr int kRounds = 4;
  std::uint64_t permute(std::uint64_t value) const;

  std::uint64_t count_;
  int half_bits_;
  std::uint64_t keys_[kRounds];
};

/// Cuts a set of window indices into batches, one for each step, in a new order each epoch of
/// batches_per_epoch() steps. A batch is a pure function of (indices, batch size, seed, step): a resumed run
/// needs no other state. Every batch is full; the remainder of indices.size() / batch is left out, others in
/// each epoch. With fewer indices than the batch size an epoch is one batch of all of them.
class Batching {
 public:
  /// Throws std::invalid_argument when there is no index or batch < 1.
  Batching(std::vector<std::uint32_t> indices, std::size_t batch, std::uint64_t seed);
  std::size_t batches_per_epoch() const { return indices_.size() / batch_; }
  const std::vector<std::uint32_t>& indices() const { return indices_; }
  std::size_t batch_size() const { return batch_; }
  /// Writes the batch_size() window indices of a step's batch, steps being counted from 0. Throws
  /// std::invalid_argument when out is of another size.
  void batch(std::uint64_t step, std::span<std::uint32_t> out) const;
  /// Number of the sample in slot i of that batch, counted since training began: the counter for augment().
  std::uint64_t sample(std::uint64_t step, std::size_t i) const { return step * batch_ + i; }

 private:
  std::vector<std::uint32_t> indices_;
  std::size_t batch_;
  std::uint64_t seed_;
};

}  // namespace supertac
