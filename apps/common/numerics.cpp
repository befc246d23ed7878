#include "apps/common/numerics.h"

#include "autograd/kernels/isa.h"

namespace supertac {

std::string numerics_text() {
  return "kernels   " + std::string(kernels::isa_kernels().name) +
         " (SUPERTAC_ISA=avx512|avx2|portable overrides)\n" + "OpenBLAS  not used\n";
}

}  // namespace supertac
