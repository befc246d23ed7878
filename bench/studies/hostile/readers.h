// Seeded mutants through the readers, in process.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace supertac {

/// `n` mutants in all, spread over twelve readers; files among them are written in `folder`. Counts
/// "mutants", "slow mutants" (over .1 s) and "raw exceptions" (of a type that is none of ours).
std::map<std::string, std::uint64_t> mutants_of_readers(const std::string& folder, std::uint64_t n,
                                                        std::uint64_t seed);

}  // namespace supertac
