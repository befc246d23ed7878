// Functions whose bits do not depend on the C library: whatever reaches a recording, a checkpoint or a
// picture is computed from +, -, *, / and sqrt, which IEEE 754 rounds the same way everywhere. Periods are
// counted in turns, so that taking whole ones off is exact.
#pragma once

namespace supertac::same_bits {

/// e^x, relative error below 1e-15; infinity above 709.78, 0 below -708.4.
double exp(double x);

/// The natural logarithm, relative error below 1e-15. Minus infinity at 0, NaN below.
double log(double x);

/// x^y = exp(y log x) for x >= 0 and y > 0; relative error below 1e-15 (1 + |y log x|).
double pow(double x, double y);

/// cos(2 pi turns) and sin(2 pi turns), relative error below 1e-15.
double cosine(double turns);
double sine(double turns);

/// sin(2 pi turns) to 2e-4, from a handful of products: what the simulator's vibrations are made of.
double rough_sine(double turns);

/// exp(-d^2 / 2 sigma^2) nearly: (1 - d^2 / 16 sigma^2)^8, and 0 beyond 4 sigma.
double bell(double distance, double sigma);

}  // namespace supertac::same_bits
