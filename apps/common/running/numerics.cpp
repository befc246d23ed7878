#include "apps/common/running/numerics.h"

#include "autograd/kernels/fast/isa/isa.h"

// Weak: programs without ridge regression do not link OpenBLAS, and have nothing to say about it.
extern "C" char* openblas_get_config() __attribute__((weak));

namespace supertac {

Numerics numerics() {
  const kernels::IsaKernels& chosen = kernels::isa_kernels();
  Numerics n;
  n.text =
      "kernels   " + std::string(chosen.name) + " (SUPERTAC_ISA=avx512|avx2|neon|portable|plain overrides)\n";
  if (openblas_get_config != nullptr)
    n.text += "algebra   " + std::string(openblas_get_config()) + ", one thread of it\n";
  if (&chosen == &kernels::kPortableKernels) {
    n.warning =
        "this processor has no fused multiply-add: results are the same, but computing takes many times "
        "longer";
  }
  return n;
}

}  // namespace supertac
