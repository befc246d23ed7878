// What the attacks share: evil values, mutants of good files, files that lie, devices that lie. Each attack
// runs `n` cases of `seed` and returns its counts by name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/numbers/random.h"

namespace supertac {

using Bytes = std::vector<std::byte>;
using Counts = std::map<std::string, std::uint64_t>;

/// A value of an option, or of a file's entry, by somebody who means no good.
std::string evil_value(const RandomStream& random, std::uint64_t at);

/// Reads something hostile; counts "slow mutants" (over 0.1 s of processor), "crashes" (a broken promise of
/// the reader's) and "raw exceptions" (of a type that is none of ours), and says on stderr which it was.
void judge_reading(const std::string& what, const std::function<void()>& read, Counts& counts);

/// A small recording, model and file of pairs, written in `folder`: their bytes.
Bytes good_recording(const std::string& folder);
Bytes good_model(const std::string& folder);
Bytes good_pairs(const std::string& folder);

/// Mutants, spread over all readers, in this process; files among them are written in `folder`. Counts
/// "mutants", and as judge_reading().
Counts mutants_of_readers(const std::string& folder, std::uint64_t n, std::uint64_t seed);

/// Files whose checksums are right and whose entries are not, through the readers and what follows them: a
/// recording's windows, a model's pictures, the baselines of pairs, a sensor's decoder, a journal's passes.
/// Counts "lying files", and as judge_reading().
Counts lying_files(const std::string& folder, std::uint64_t n, std::uint64_t seed);

/// Collections in simulated time with printers that lie. Counts "collections", "complete", "typed errors" and
/// "broken promises", which are those of run_faulty_collection().
Counts lying_devices(std::uint64_t n, std::uint64_t seed);

}  // namespace supertac
