// How many threads a machine grants.
#pragma once

#include <optional>
#include <string_view>

namespace supertac {

/// How many threads a program takes when none are asked for: what OpenMP says (OMP_NUM_THREADS, else the
/// processors of the affinity mask), at most the cgroup's CPU quota rounded up.
int default_threads();

/// The quota in a cgroup's cpu.max ("200000 100000", "max 100000"), in processors rounded up; nullopt when
/// there is none or the text cannot be read.
std::optional<int> quota_of_cpu_max(std::string_view text);

}  // namespace supertac
