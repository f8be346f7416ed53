// SPDX-License-Identifier: MIT
#include "stiffmap/stability.hpp"

namespace stiffmap {
namespace {

constexpr double tangent_round_off = 1e-11;  // of the scaled tangent

}  // namespace

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
