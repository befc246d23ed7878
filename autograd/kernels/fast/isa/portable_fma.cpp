#define SUPERTAC_SCALAR_FMA
#include "autograd/kernels/fast/isa/portable.cpp"  // NOLINT(bugprone-suspicious-include)
