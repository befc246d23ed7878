#include "apps/common/running/numerics.h"

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac {

Numerics numerics() {
  const kernels::IsaKernels& chosen = kernels::isa_kernels();
  Numerics n;
  n.text =
      "kernels   " + std::string(chosen.name) + " (SUPERTAC_ISA=avx512|avx2|neon|portable|plain overrides)\n";
  if (&chosen == &kernels::kPortableKernels) {
    n.warning =
        "this processor has no fused multiply-add: results are the same, but computing takes many times "
        "longer";
  }
  return n;
}

}  // namespace supertac
