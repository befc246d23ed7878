// What is well formed and lies: files with right checksums, printers that answer, boards and hosts out of
// time.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace supertac {

/// `n` files whose checksums are right and whose entries are not, through the readers and what follows them:
/// a recording's windows, a model's pictures, the baselines of pairs, a sensor's decoder, a journal's passes.
/// Counts "lying files", and as judge_reading().
std::map<std::string, std::uint64_t> lying_files(const std::string& folder, std::uint64_t n,
                                                 std::uint64_t seed);

/// `n` collections in simulated time. Counts "collections", "complete", "typed errors" and "broken promises":
/// those of run_faulty_collection(), that the end comes within an hour of the rig's, and that Stop on a page
/// is heard once, within 2 s, whatever other tabs do.
std::map<std::string, std::uint64_t> lying_devices(std::uint64_t n, std::uint64_t seed);

}  // namespace supertac
