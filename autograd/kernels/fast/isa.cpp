#include "autograd/kernels/fast/isa.h"

#include <atomic>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace supertac::kernels {
namespace {

const IsaKernels& portable() {
  return __builtin_cpu_supports("fma") ? kPortableFmaKernels : kPortableKernels;
}

#ifdef SUPERTAC_REAL_IS_DOUBLE

const IsaKernels& choose() { return portable(); }

#else

bool has_avx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
bool has_avx512() { return has_avx2() && __builtin_cpu_supports("avx512f"); }

[[noreturn]] void refuse(const std::string& wanted, const std::string& why) {
  throw std::runtime_error("SUPERTAC_ISA=" + wanted + ": " + why +
                           "; use avx512, avx2 or portable, or unset it to let the program choose");
}

const IsaKernels& choose() {
  const char* setting = std::getenv("SUPERTAC_ISA");
  const std::string wanted = setting == nullptr ? "" : setting;
  if (wanted.empty()) return has_avx512() ? kAvx512Kernels : has_avx2() ? kAvx2Kernels : portable();
  if (wanted == "portable") return portable();
  if (wanted == "avx2")
    return has_avx2() ? kAvx2Kernels : (refuse(wanted, "this processor has no AVX2"), portable());
  if (wanted == "avx512") {
    return has_avx512() ? kAvx512Kernels : (refuse(wanted, "this processor has no AVX-512"), portable());
  }
  refuse(wanted, "not a known instruction set");
}

#endif

std::atomic<const IsaKernels*>& chosen() {
  static std::atomic<const IsaKernels*> set{&choose()};
  return set;
}

}  // namespace

const IsaKernels& isa_kernels() { return *chosen().load(std::memory_order_relaxed); }

void use_isa(const IsaKernels& set) { chosen() = &set; }

}  // namespace supertac::kernels
