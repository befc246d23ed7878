#define SUPERTAC_SCALAR_FMA
#include "autograd/kernels/portable.cpp"
