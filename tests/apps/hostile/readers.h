// Seeded mutants through the readers, in process.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace supertac {

/// Reads something hostile; counts "slow mutants" (over .1 s of processor), "crashes" (a broken promise of
/// the reader's) and "raw exceptions" (of a type that is none of ours), and says on stderr which it was.
void judge_reading(const std::string& what, const std::function<void()>& read,
                   std::map<std::string, std::uint64_t>& counts);

/// A small recording, model and file of pairs, written in `folder`: their bytes.
std::vector<std::byte> good_recording(const std::string& folder);
std::vector<std::byte> good_model(const std::string& folder);
std::vector<std::byte> good_pairs(const std::string& folder);

/// `n` mutants in all, spread over twelve readers; files among them are written in `folder`. Counts
/// "mutants", and as judge_reading().
std::map<std::string, std::uint64_t> mutants_of_readers(const std::string& folder, std::uint64_t n,
                                                        std::uint64_t seed);

}  // namespace supertac
