// Loops over single elements, callable without a graph. Gradients are added into gx.
#pragma once

#include <span>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// y = x > 0 ? x : slope * x. The gradient reads the sign of y, which is the sign of x for slope >= 0.
void leaky_relu(Dim n, real slope, const real* x, real* y);
void leaky_relu_grad(Dim n, real slope, const real* gy, const real* y, real* gx);
/// g = y > 0 ? g : slope * g
void rectify_in_place(Dim n, real slope, const real* y, real* g);

/// y = 1 / (1 + e^-x);  gx += gy y (1 - y)
void sigmoid(Dim n, const real* x, real* y);
void sigmoid_grad(Dim n, const real* gy, const real* y, real* gx);

/// y = min(max(x, low), high);  gx += gy where low <= x <= high
void clamp(Dim n, real low, real high, const real* x, real* y);
void clamp_grad(Dim n, real low, real high, const real* gy, const real* x, real* gx);

/// z = mean + e^(log_var / 2) eps;  glog_var += gz (z - mean) / 2, which is half of e^(log_var / 2) eps
void sample_gaussian(Dim n, const real* mean, const real* log_var, const real* eps, real* z);
void sample_gaussian_grad_log_var(Dim n, const real* gz, const real* z, const real* mean, real* glog_var);

void add(Dim n, const real* a, const real* b, real* y);
void multiply(Dim n, const real* a, const real* b, real* y);
void scale(Dim n, real factor, const real* x, real* y);
/// y += factor * x
void add_scaled(Dim n, real factor, const real* x, real* y);
/// y += x, the same number everywhere
void add_constant(Dim n, real x, real* y);
/// y = 0 + the sum of all parts as a balanced binary tree: neighbours, then pairs of pairs. At least one
/// part.
void add_as_tree(Dim n, std::span<const real* const> parts, real* y);
/// y = or += x
void put(Dim n, const real* x, Into into, real* y);
/// y += a * b
void add_product(Dim n, const real* a, const real* b, real* y);

/// The sum of all elements, and of their squares, in double precision and a fixed order.
double sum(Dim n, const real* x);
double sum_of_squares(Dim n, const real* x);

}  // namespace supertac::kernels
