#include "autograd/optimisers/adam.h"

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::orthogonal_test {

using namespace test;
using Matrix = std::vector<double>;

// a [n,k] times b [k,m], or times the transposed of b [m,k].
Matrix product(Dim n, Dim k, Dim m, const Matrix& a, const Matrix& b, bool transposed = false) {
  Matrix y(static_cast<std::size_t>(n * m));
  for (Dim i = 0; i < n * m; ++i)
    for (Dim l = 0; l < k; ++l) {
      const Dim of_b = transposed ? i % m * k + l : l * m + i % m;
      y[static_cast<std::size_t>(i)] +=
          a[static_cast<std::size_t>(i / m * k + l)] * b[static_cast<std::size_t>(of_b)];
    }
  return y;
}

// The steps as the header has them, on x itself, in double precision.
Matrix reference(Dim rows, Dim columns, Matrix x) {
  const double length = std::sqrt(std::inner_product(x.begin(), x.end(), x.begin(), 0.0));
  for (double& v : x) v /= length + 1e-7;
  for (int step = 0; step < 5; ++step) {
    const Matrix s = product(rows, columns, rows, x, x, true);
    const Matrix sx = product(rows, rows, columns, s, x), ssx = product(rows, rows, columns, s, sx);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = 3.4445 * x[i] - 4.7750 * sx[i] + 2.0315 * ssx[i];
  }
  return x;
}

Matrix values_of(const Tensor& x) { return {x.values().begin(), x.values().end()}; }

TEST(Orthogonal, TakesTheStepsOfItsFormula) {
  for (const auto& [rows, columns] : {std::pair<Dim, Dim>{288, 32}, {64, 512}, {8, 8}, {12, 16}, {80, 9}}) {
    Tensor x = numbers({rows, columns}, 7);
    const Matrix expected = reference(rows, columns, values_of(x));
    orthogonalise(rows, columns, x.data());
    const Matrix found = values_of(x);
    for (std::size_t i = 0; i < found.size(); ++i)
      ASSERT_NEAR(found[i], expected[i], 2e-4) << rows << " x " << columns << ", element " << i;
  }
}

TEST(Orthogonal, SizeMattersNotAndNothingStaysNothing) {
  const Tensor x = numbers({16, 24}, 5);
  Tensor small = x.clone(), large = x.clone(), nothing = Tensor::zeros({16, 24});
  for (real& v : small.values()) v *= real(0.0078125);
  for (real& v : large.values()) v *= real(65536);
  for (Tensor* t : {&small, &large, &nothing}) orthogonalise(16, 24, t->data());
  for (Dim i = 0; i < x.size(); ++i) ASSERT_NEAR(small.data()[i], large.data()[i], 1e-5);
  for (const real v : nothing.values()) ASSERT_EQ(v, 0);
  Tensor faint = Tensor::full({16, 24}, real(1e-12));  // far below the 1e-7 beside its norm
  orthogonalise(16, 24, faint.data());
  for (const real v : faint.values()) ASSERT_LT(std::abs(v), 0.01);
}

}  // namespace supertac::orthogonal_test
