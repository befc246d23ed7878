// All loops of an instruction set over the vector type that its source defines (kernels.inl, which the others
// build on), and their table.

#include "autograd/kernels/fast/isa/kernels.inl"

#include "autograd/kernels/fast/isa/inference.inl"
#include "autograd/kernels/fast/isa/winograd.inl"

// A table is a constant of the program (constinit): no code of this instruction set may run before the
// processor is known.
constexpr IsaKernels set_of(std::string_view name, Vectors vectors) {
  return {name,         vectors,   gather,  gather_rows, outer, filters, filter_grads, patches,   squares,
          square_grads, transpose, product, places,      gate,  mean,    planes,       plane_conv};
}
