// SPDX-License-Identifier: MIT
#include <Eigen/Eigenvalues>
#include <boost/test/unit_test.hpp>
#include <limits>

#include "machines.hpp"
#include "numeric.hpp"

using namespace stiffmap;
using namespace stiffmap::test;

namespace {

MatX random_symmetric(Random& random, Index n, Index rank) {
  MatX A = MatX::Zero(n, n);
  for (Index i = 0; i < rank; ++i) {
    const VecX v = random.vector(n, 1);
    A += (i % 3 == 0 ? -1 : 1) * v * v.transpose();
  }
  return A;
}

/// A saddle matrix with a zero block, as the tangent has.
MatX random_saddle(Random& random, Index n, Index k) {
  MatX A = MatX::Zero(n + k, n + k);
  A.topLeftCorner(n, n) = random_symmetric(random, n, n);
  for (Index i = 0; i < k; ++i) A.col(n + i).head(n) = random.vector(n, 1);
  A.bottomLeftCorner(k, n) = A.topRightCorner(n, k).transpose();
  return A;
}

Inertia by_eigenvalues(const MatX& A, double threshold) {
  Inertia out;
  const Eigen::SelfAdjointEigenSolver<MatX> solver(A, Eigen::EigenvaluesOnly);
  for (double v : solver.eigenvalues()) (std::abs(v) < threshold ? out.zero : v > 0 ? out.positive : out.negative) += 1;
  return out;
}

void check_inertia(MatX A) {
  const Inertia wanted = by_eigenvalues(A, 1e-9), got = symmetric_inertia(A, 1e-9);
  BOOST_TEST(got.positive == wanted.positive);
  BOOST_TEST(got.negative == wanted.negative);
  BOOST_TEST(got.zero == wanted.zero);
}

}  // namespace

BOOST_AUTO_TEST_SUITE(saddle)

BOOST_AUTO_TEST_CASE(a_matrix_with_nan_has_no_inertia) {
  for (const Index n : {1, 2, 7}) {
    MatX A = MatX::Identity(n, n);
    A(n - 1, 0) = A(0, n - 1) = std::numeric_limits<double>::quiet_NaN();
    const Inertia got = symmetric_inertia(A, 1e-9);
    BOOST_TEST(got.zero == n);
    BOOST_TEST(got.positive + got.negative == 0);
  }
}

BOOST_AUTO_TEST_CASE(inertia_agrees_with_eigenvalues) {
  Random random(1);
  for (Index n : {1, 2, 3, 5, 8, 13, 21})
    for (Index rank = 0; rank <= n; ++rank) check_inertia(random_symmetric(random, n, rank));
  for (Index n : {2, 4, 9, 16})
    for (Index k : {1, 2}) check_inertia(random_saddle(random, n, k));
}

BOOST_AUTO_TEST_CASE(inertia_of_zero_diagonals) {
  MatX A(2, 2);
  A << 0, 1, 1, 0;
  check_inertia(A);
  MatX B = MatX::Zero(4, 4);
  B(0, 3) = B(3, 0) = 2;
  B(1, 2) = B(2, 1) = -1;
  check_inertia(B);
  check_inertia(MatX::Zero(3, 3));
}

BOOST_AUTO_TEST_CASE(solution_satisfies_the_unscaled_equations) {
  const Mechanism m = Orthoglide().build();
  Problem p(m);
  p.base = m.home_coordinates;
  State state(m);
  state.lambda = Random(2).vector(m.closures(), 300);
  Linearization lin(m);
  linearize(m, p, state, lin);
  SaddleSystem saddle(m);
  saddle.assemble(m, lin);
  saddle.factorize();
  BOOST_TEST(saddle.regular());
  const VecX force = Random(3).vector(m.size(), 100), closure = Random(4).vector(m.closures(), 1e-3);
  VecX dz(m.size()), dl(m.closures());
  saddle.solve(force, closure, dz, dl);
  MatX T = lin.K - lin.H;
  for (Index j = 0; j < m.size(); ++j) T(j, j) += lin.dtau[j];
  // Springs carry 1e4..1e9 N/m: the balance is met to the round-off of its largest terms.
  const double size = (T.cwiseAbs() * dz.cwiseAbs()).maxCoeff();
  BOOST_TEST((T * dz - lin.J.transpose() * dl - force).cwiseAbs().maxCoeff() < 1e-11 * size);
  BOOST_TEST((-lin.J * dz - closure).cwiseAbs().maxCoeff() < 1e-11);
}

BOOST_AUTO_TEST_CASE(determinant_sign_agrees_with_eigen) {
  const Mechanism m = Orthoglide().build();
  Problem p(m);
  p.base = m.home_coordinates;
  Linearization lin(m);
  linearize(m, p, State(m), lin);
  SaddleSystem saddle(m);
  saddle.assemble(m, lin);
  saddle.factorize();
  // inertia (n, k) of a stable saddle: the sign of the determinant is (-1)^k
  BOOST_TEST(saddle.determinant_sign() == (m.closures() % 2 ? -1.0 : 1.0));
  const Inertia i = by_eigenvalues(saddle.matrix(), 1e-12);
  BOOST_TEST(i.negative == m.closures());
}

BOOST_AUTO_TEST_CASE(null_space_of_a_parallelogram) {
  Orthoglide g;
  const Chain chain{{Block{"bars", {{"low", g.bar(-1)}, {"high", g.bar(1)}}}}};
  const Mechanism m = assemble(chain, {Vec3(g.L, 0, 0), Mat3::Identity()});
  Problem p(m);
  p.base = m.home_coordinates;
  Linearization lin(m);
  linearize(m, p, State(m), lin);
  SaddleSystem saddle(m);
  saddle.assemble(m, lin);
  saddle.factorize();
  BOOST_TEST(!saddle.regular());
  const MatX null = saddle.null_space();
  BOOST_TEST(null.cols() == 1);
  BOOST_TEST((saddle.matrix() * null).norm() < 1e-9);
}

BOOST_AUTO_TEST_SUITE_END()
