// SPDX-License-Identifier: MIT
#include "stiffmap/stiffness/stability.hpp"

namespace stiffmap {
namespace {

constexpr double tangent_round_off = 1e-11;  // of the scaled tangent
constexpr double no_growth = 1e-9;           // of the eigenvalues of a reduced tangent

/// Columns: motions that springs, laws and joints allow before the loops are closed, as lengths.
MatX allowed(const Mechanism& m, const Linearization& lin) {
  const Index n = m.size();
  MatX out = MatX::Zero(n, n);
  Index used = 0;
  std::vector<bool> done(at(n), false);
  for (const SpringGroup& g : m.groups) {
    if (!g.matrix.rotated) continue;
    for (int i = 0; i < 6; ++i) {
      done[at(g.first + i)] = true;
      if (g.matrix.rigid[i]) continue;
      out.col(used++).segment<6>(g.first) = g.matrix.basis.col(i);
    }
  }
  for (Index j = 0; j < n; ++j)
    if (!done[at(j)] && lin.kind[at(j)] != Kind::fixed) out(j, used++) = 1 / m.unit(j);
  return out.leftCols(used);
}

}  // namespace

MatX closed_motions(const Mechanism& m, const Linearization& lin) {
  const MatX P = allowed(m, lin);
  if (m.closures() == 0) return P;
  MatX C = lin.J * P;
  scale_angles(m, C);
  return P * left_null_vectors(C.transpose(), rank_threshold);
}

MatX springs_only(const Mechanism& m, const Linearization& lin) {
  MatX out = lin.K;
  for (Index j = 0; j < m.size(); ++j)
    if (m.coordinates[at(j)].law >= 0 && lin.da[j] != 0) out(j, j) += lin.dtau[j] / lin.da[j];
  return out;
}

MatX reduced_tangent(const Mechanism& m, const Linearization& lin, const MatX& Z) {
  return congruent(springs_only(m, lin) - lin.H, Z);
}

bool grows(const Mechanism& m, const Linearization& lin) {
  const VecX real = general_eigen(reduced_tangent(m, lin, closed_motions(m, lin))).values.real();
  return real.minCoeff() < -no_growth * real.maxCoeff();
}

/// Elastic coordinates first, where they are stable by themselves: what is left has their signs taken out
/// (Haynsworth). False where they are not, or nearly not.
bool Stability::eliminated(const MatX& A) {
  const Index n = static_cast<Index>(elastic_.size()), left = static_cast<Index>(rest_.size());
  const auto symmetric = [&](Index i, Index j) { return 0.5 * (A(i, j) + A(j, i)); };
  K_.resize(n, n);
  B_.resize(n, left);
  S_.resize(left, left);
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i < n; ++i) K_(i, j) = symmetric(elastic_[at(i)], elastic_[at(j)]);
  if (n == 0) return false;
  if (!cholesky(K_) || K_.diagonal().cwiseAbs2().minCoeff() < safe_pivot) return false;
  for (Index j = 0; j < left; ++j) {
    for (Index i = 0; i < n; ++i) B_(i, j) = symmetric(elastic_[at(i)], rest_[at(j)]);
    for (Index i = 0; i < left; ++i) S_(i, j) = symmetric(rest_[at(i)], rest_[at(j)]);
  }
  for (Index j = 0; j < left; ++j)  // B becomes L^-1 B
    for (Index i = 0; i < n; ++i) {
      B_(i, j) /= K_(i, i);
      B_.col(j).tail(n - i - 1) -= B_(i, j) * K_.col(i).tail(n - i - 1);
    }
  for (Index j = 0; j < left; ++j)
    for (Index i = j; i < left; ++i) S_(i, j) = S_(j, i) -= B_.col(i).dot(B_.col(j));
  return true;
}

Index Stability::falling(const SaddleSystem& saddle) {
  const MatX& A = saddle.matrix();
  elastic_.clear();
  rest_.clear();
  const Index coordinates = static_cast<Index>(saddle.kind().size());
  for (Index j = 0; j < A.rows(); ++j) {
    const Kind kind = j < coordinates ? saddle.kind()[at(j)] : Kind::free;
    if (kind == Kind::fixed) continue;
    (kind == Kind::elastic ? elastic_ : rest_).push_back(j);
  }
  if (!eliminated(A)) S_ = 0.5 * (A + A.transpose());
  const Index closures = saddle.regular() ? saddle.closures() : saddle.closure_rank();
  return std::max<Index>(0, symmetric_inertia(S_, tangent_round_off).negative - closures);
}

}  // namespace stiffmap
