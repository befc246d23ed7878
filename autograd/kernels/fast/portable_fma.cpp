#define SUPERTAC_SCALAR_FMA
#include "autograd/kernels/fast/portable.cpp"
