#include "autograd/kernels/fast/isa/isa.h"

#include <atomic>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace supertac::kernels {

const IsaKernels kPlainKernels{"plain"};

namespace {

struct Set {
  const IsaKernels* kernels;
  bool runs_here;
};

// The best first.
std::vector<Set> all_sets() {
  std::vector<Set> sets;
#ifdef __x86_64__
  const bool fma = __builtin_cpu_supports("fma");
#ifndef SUPERTAC_REAL_IS_DOUBLE
  const bool avx2 = fma && __builtin_cpu_supports("avx2");
  sets.push_back({&kAvx512Kernels, avx2 && __builtin_cpu_supports("avx512f")});
  sets.push_back({&kAvx2Kernels, avx2});
#endif
  sets.push_back({&kPortableFmaKernels, fma});
#elif defined(__aarch64__) && !defined(SUPERTAC_REAL_IS_DOUBLE)
  sets.push_back({&kNeonKernels, true});
#endif
  sets.push_back({&kPortableKernels, true});
  sets.push_back({&kPlainKernels, true});
  return sets;
}

[[noreturn]] void refuse(const std::string& wanted, const std::string& why) {
  std::string names;
  for (const Set& set : all_sets()) {
    const std::string name = std::string(set.kernels->name) + ", ";
    if (!names.ends_with(name)) names += name;  // portable stands there twice
  }
  throw std::runtime_error("SUPERTAC_ISA=" + wanted + ": " + why + "; use one of " + names +
                           "or unset it to let the program choose");
}

const IsaKernels& choose() {
  // The double build has few sets; a setting that is meant for the programs would stop it.
  const char* setting = sizeof(real) == sizeof(double) ? nullptr : std::getenv("SUPERTAC_ISA");
  const std::string wanted = setting == nullptr ? "" : setting;
  bool known = false;
  for (const Set& set : all_sets()) {
    if (!wanted.empty() && set.kernels->name != wanted) continue;
    if (set.runs_here) return *set.kernels;
    known = true;
  }
  refuse(wanted, known ? "this processor does not have it" : "not a known instruction set");
}

std::atomic<const IsaKernels*>& chosen() {
  static std::atomic<const IsaKernels*> set{&choose()};
  return set;
}

}  // namespace

std::vector<const IsaKernels*> supported_sets() {
  std::vector<const IsaKernels*> sets;
  for (const Set& set : all_sets()) {
    if (set.runs_here) sets.push_back(set.kernels);
  }
  return sets;
}

const IsaKernels& isa_kernels() { return *chosen().load(std::memory_order_relaxed); }

void use_isa(const IsaKernels& set) { chosen() = &set; }

}  // namespace supertac::kernels
