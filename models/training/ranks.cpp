#include "models/training/ranks.h"

#include <bit>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "io/files/json.h"

namespace supertac {
namespace {

std::string value_of(const nlohmann::ordered_json& all, const std::string& entry) {
  return all.contains(entry) ? all[entry].get<std::string>() : "missing";
}

}  // namespace

std::vector<std::string> Ranks::gather(const std::string& mine) {
  std::vector<std::string> all(static_cast<std::size_t>(size_));
  all[static_cast<std::size_t>(rank_)] = mine;
  for (int apart = 1; apart < size_; ++apart) {
    const int partner = rank_ ^ apart;
    const std::uint64_t length = mine.size();
    std::uint64_t its_length = 0;
    exchange(partner, std::as_bytes(std::span(&length, 1)),
             std::as_writable_bytes(std::span(&its_length, 1)));
    std::string& theirs = all[static_cast<std::size_t>(partner)];
    theirs.resize(its_length);
    exchange(partner, std::as_bytes(std::span(mine)), std::as_writable_bytes(std::span(theirs)));
  }
  return all;
}

template <class T>
static void add_up_over(Ranks& ranks, std::span<T> values, std::span<T> buffer) {
  for (int apart = 1; apart < ranks.size(); apart *= 2) {
    ranks.exchange(ranks.rank() ^ apart, std::as_bytes(values), std::as_writable_bytes(buffer));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += buffer[i];
  }
}
void Ranks::add_up(std::span<double> values, std::span<double> buffer) { add_up_over(*this, values, buffer); }
void Ranks::add_up(std::span<float> values, std::span<float> buffer) { add_up_over(*this, values, buffer); }

Ranks& one_process() {
  static Ranks alone(0, 1);
  return alone;
}

void check_micro_batches(int ranks, std::size_t batch) {
  if (ranks == 1) return;
  if (batch < 8)
    throw std::invalid_argument("several processes need a batch of at least 8, got " + std::to_string(batch) +
                                "; give a larger --batch or start one process");
  const std::size_t micro_batches = micro_batches_of(batch);
  if (std::has_single_bit(static_cast<unsigned>(ranks)) && static_cast<std::size_t>(ranks) <= micro_batches)
    return;
  throw std::invalid_argument(std::to_string(ranks) + " processes cannot share the " +
                              std::to_string(micro_batches) + " micro-batches of a batch of " +
                              std::to_string(batch) + " evenly; start 1, 2, 4" +
                              (micro_batches > 8 ? ", 8 or 16" : " or 8") + " processes");
}

std::optional<Disagreement> find_disagreement(Ranks& ranks, const std::map<std::string, std::string>& mine) {
  std::vector<nlohmann::ordered_json> all;
  for (const std::string& text : ranks.gather(nlohmann::ordered_json(mine).dump()))
    all.push_back(parse_json_limited(text));
  for (std::size_t r = 1; r < all.size(); ++r)
    for (const auto& its : {all[0], all[r]})
      for (const auto& [entry, value] : its.items())
        if (value_of(all[r], entry) != value_of(all[0], entry))
          return Disagreement{static_cast<int>(r), entry, value_of(all[r], entry), value_of(all[0], entry)};
  return std::nullopt;
}

}  // namespace supertac
