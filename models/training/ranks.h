// Processes that train one model together. Each holds the whole model; rank r of R sums the gradients of its
// neighbouring micro-batches, then R ranks add theirs pairwise. IEEE addition commutes, so both partners
// of a pair get the same bits, those of a single process (models/training/trainer.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace supertac {

/// The ranks cannot go on: they disagree. All throw it with the same text.
class RanksError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Who this process is among others, and how two of them swap bytes.
class Ranks {
 public:
  Ranks(int rank, int size) : rank_(rank), size_(size) {}
  virtual ~Ranks() = default;
  int rank() const { return rank_; }
  int size() const { return size_; }
  bool first() const { return rank_ == 0; }

  /// Sends `mine` and fills `theirs`; the partner calls it with sizes the other way round. A process that is
  /// alone has no partner.
  virtual void exchange(int, std::span<const std::byte>, std::span<std::byte>) {}

  /// The texts of all ranks, by rank. For sizes that are powers of two.
  std::vector<std::string> gather(const std::string& mine);
  /// Makes `values` the sum over all ranks, a balanced binary tree; `buffer` is of the same size.
  void add_up(std::span<double> values, std::span<double> buffer);
  void add_up(std::span<float> values, std::span<float> buffer);

 private:
  int rank_, size_;
};

/// A process that is alone.
Ranks& one_process();

inline constexpr std::size_t kMostMicroBatches = 16;
/// How many micro-batches a batch is cut into: 16 where each then has eight samples or more, else 8, or one a
/// sample. With four samples each, a step of preset `paper` on one thread would take 4 % longer, as the
/// weights of linear layers are fetched for every micro-batch (bench/results/speed.md).
constexpr std::size_t micro_batches_of(std::size_t batch) {
  return batch >= 8 * kMostMicroBatches ? kMostMicroBatches : std::min<std::size_t>(batch, 8);
}
/// Throws std::invalid_argument, with advice, unless ranks is a power of two, at most
/// micro_batches_of(batch), or when several share a batch below 8.
void check_micro_batches(int ranks, std::size_t batch);

/// The first entry for which a rank has another value, `its`, than rank 0.
struct Disagreement {
  int rank = 0;
  std::string entry, its, of_first;
};
std::optional<Disagreement> find_disagreement(Ranks& ranks, const std::map<std::string, std::string>& mine);

}  // namespace supertac
