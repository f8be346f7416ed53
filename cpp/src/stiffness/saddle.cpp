// SPDX-License-Identifier: MIT
#include "stiffmap/stiffness/saddle.hpp"

#include <cmath>

namespace stiffmap {
Inertia symmetric_inertia(MatX& A, double threshold) {
  const double alpha = (1 + std::sqrt(17.0)) / 8;
  const Index n = A.rows();
  Inertia out;
  if (!A.allFinite()) {  // numbers overflowed on the way: no pivot can be chosen
    out.zero = n;
    return out;
  }
  const auto swap = [&](Index i, Index j) {
    if (i == j) return;
    A.row(i).swap(A.row(j));
    A.col(i).swap(A.col(j));
  };
  for (Index k = 0; k < n;) {
    const Index left = n - k;
    Index d = 0, p = 0, q = 0;
    const double diagonal = A.diagonal().tail(left).cwiseAbs().maxCoeff(&d);
    double largest = 0;
    for (Index j = k; j < n; ++j)
      for (Index i = j + 1; i < n; ++i)
        if (std::abs(A(i, j)) > largest) {
          largest = std::abs(A(i, j));
          p = i;
          q = j;
        }
    if (std::max(diagonal, largest) < threshold) {
      out.zero += left;
      break;
    }
    if (diagonal >= alpha * largest) {
      swap(k, k + d);
      const double a = A(k, k);
      (a > 0 ? out.positive : out.negative) += 1;
      const Index m = left - 1;
      for (Index j = 0; j < m; ++j) {
        const double f = A(k, k + 1 + j) / a;
        if (f != 0) A.col(k + 1 + j).tail(m) -= f * A.col(k).tail(m);
      }
      k += 1;
      continue;
    }
    swap(k, q);
    swap(k + 1, p == k ? q : p);
    out.positive += 1;  // |off-diagonal| dominates: one of each sign
    out.negative += 1;
    const double a = A(k, k), b = A(k + 1, k), c = A(k + 1, k + 1), det = a * c - b * b;
    const Index m = left - 2;
    for (Index j = 0; j < m; ++j) {
      const double u = A(k, k + 2 + j), v = A(k + 1, k + 2 + j);
      const double fu = (c * u - b * v) / det, fv = (a * v - b * u) / det;
      A.col(k + 2 + j).tail(m) -= fu * A.col(k).tail(m) + fv * A.col(k + 1).tail(m);
    }
    k += 2;
  }
  return out;
}

SaddleSystem::SaddleSystem(const Mechanism& m)
    : n_(m.size()),
      nl_(m.closures()),
      A_(MatX::Zero(n_ + nl_, n_ + nl_)),
      s_(VecX::Ones(n_ + nl_)),
      rhs_(VecX::Zero(n_ + nl_)),
      sol_(VecX::Zero(n_ + nl_)),
      kind_(static_cast<std::size_t>(n_)),
      lu_(n_ + nl_),
      cod_(n_ + nl_, n_ + nl_) {
  for (std::size_t g = 0; g < m.groups.size(); ++g)
    if (m.groups[g].matrix.rotated) rotated_.push_back({m.groups[g].first, m.groups[g].matrix});
}

void SaddleSystem::assemble(const Mechanism& m, const Linearization& lin) {
  auto T = A_.topLeftCorner(n_, n_);
  T.noalias() = lin.K - lin.H;
  for (Index j = 0; j < n_; ++j)
    if (lin.da[j] != 1) {
      T.row(j) *= lin.da[j];
      T.col(j) *= lin.da[j];
    }
  for (Index j = 0; j < n_; ++j) T(j, j) += lin.da[j] * lin.dtau[j];
  A_.bottomLeftCorner(nl_, n_) = -lin.J;
  for (Index j = 0; j < n_; ++j)
    if (lin.da[j] != 1) A_.bottomLeftCorner(nl_, n_).col(j) *= lin.da[j];
  for (const auto& [first, spring] : rotated_) {
    A_.leftCols(n_).middleCols<6>(first) *= spring.basis;
    T.middleRows<6>(first) = (spring.basis.transpose() * T.middleRows<6>(first)).eval();
  }

  const double k0 = std::sqrt(m.stiffness);
  for (Index j = 0; j < n_; ++j) {
    const double k = lin.da[j] * (lin.da[j] * lin.K(j, j) + lin.dtau[j]);
    s_[j] = lin.kind[at(j)] == Kind::elastic && k > 0 ? 1 / std::sqrt(k) : 1 / (k0 * m.unit(j));
  }
  for (const auto& [first, spring] : rotated_)
    for (int i = 0; i < 6; ++i) {
      const double k = spring.stiffness(i, i);
      s_[first + i] = k > 0 ? 1 / std::sqrt(k) : 1 / k0;
    }
  for (Index i = 0; i < nl_; ++i) s_[n_ + i] = i % 6 < 3 ? k0 : k0 * m.length;
  // Symmetric scaling; the closure rows were assembled once, below the diagonal.
  T = s_.head(n_).asDiagonal() * T * s_.head(n_).asDiagonal();
  A_.bottomLeftCorner(nl_, n_) = s_.tail(nl_).asDiagonal() * A_.bottomLeftCorner(nl_, n_) * s_.head(n_).asDiagonal();
  A_.topRightCorner(n_, nl_) = A_.bottomLeftCorner(nl_, n_).transpose();

  const auto fix = [&](Index j) {
    A_.row(j).setZero();
    A_.col(j).setZero();
    A_(j, j) = 1;
  };
  kind_ = lin.kind;
  for (const auto& [first, spring] : rotated_)
    for (int i = 0; i < 6; ++i) kind_[at(first + i)] = spring.rigid[i] ? Kind::fixed : Kind::elastic;
  for (Index j = 0; j < n_; ++j)
    if (kind_[at(j)] == Kind::fixed) fix(j);
}

void SaddleSystem::stiffen(double by) {
  for (Index j = 0; j < n_; ++j)
    if (kind_[at(j)] != Kind::fixed) A_(j, j) += by;
}

void SaddleSystem::factorize() {
  lu_.compute(A_);
  if (A_.size() == 0) {  // a rigid machine without coordinates
    sign_ = 1;
    regular_ = well_conditioned_ = true;
    return;
  }
  const auto pivots = lu_.pivots();
  double lowest = std::abs(pivots[0]), highest = lowest;
  sign_ = lu_.exchanges();
  for (const double pivot : pivots) {
    lowest = std::min(lowest, std::abs(pivot));
    highest = std::max(highest, std::abs(pivot));
    if (pivot < 0) sign_ = -sign_;
  }
  regular_ = well_conditioned_ = lowest > pivot_alarm * std::min(1.0, highest);
  if (well_conditioned_) return;
  cod_.compute(A_, rank_threshold);
  regular_ = cod_.rank() == A_.rows();
}

void SaddleSystem::solve(const VecX& force, const VecX& closure, VecX& dz, VecX& dlambda) {
  rhs_.head(n_) = force;
  rhs_.tail(nl_) = closure;
  to_forces(rhs_);
  if (well_conditioned_) lu_.solve(rhs_, sol_);
  else cod_.solve(rhs_, sol_);
  to_coordinates(sol_);
  dz = sol_.head(n_);
  dlambda = sol_.tail(nl_);
}

void SaddleSystem::to_coordinates(VecX& v) const {
  v.array() *= s_.array();
  for (const auto& [first, spring] : rotated_) v.segment<6>(first) = (spring.basis * v.segment<6>(first)).eval();
}

void SaddleSystem::to_forces(VecX& v) const {
  for (const auto& [first, spring] : rotated_) {
    v.segment<6>(first) = (spring.basis.transpose() * v.segment<6>(first)).eval();
    for (int i = 0; i < 6; ++i)
      if (spring.rigid[i]) v[first + i] = 0;  // a reaction, not an imbalance
  }
  v.array() *= s_.array();
}

MatX SaddleSystem::null_space() const {
  if (regular_) return MatX(n_ + nl_, 0);
  const Singular svd = singular_vectors(A_);
  return svd.V.rightCols((svd.values.array() < rank_threshold).count());
}

void SaddleSystem::to_unknowns(const Linearization& lin, Eigen::Ref<MatX> J) const {
  for (Index j = 0; j < n_; ++j) J.col(j) *= lin.da[j];
  for (const auto& [first, spring] : rotated_) J.middleCols<6>(first) *= spring.basis;
  for (Index j = 0; j < n_; ++j) J.col(j) *= kind_[at(j)] == Kind::fixed ? 0.0 : s_[j];
}

Index SaddleSystem::closure_rank() const {
  if (nl_ == 0) return 0;
  return rank_of(A_.topRightCorner(n_, nl_), rank_threshold);
}

double SaddleSystem::step_norm(const Mechanism& m, const VecX& dz) const {
  double worst = 0;
  for (Index j = 0; j < n_; ++j) worst = std::max(worst, std::abs(dz[j]) * m.unit(j));
  return worst / m.length;
}

double SaddleSystem::merit(const Linearization& lin) const {
  double sum = 0;
  for (Index j = 0; j < n_; ++j)
    if (lin.kind[at(j)] != Kind::fixed) sum += std::pow(lin.r[j] * lin.da[j] * s_[j], 2);
  for (const auto& [first, spring] : rotated_) {
    const Vec6 r = spring.basis.transpose() * lin.r.segment<6>(first);
    for (int i = 0; i < 6; ++i) {
      if (lin.kind[at(first + i)] != Kind::fixed) sum -= std::pow(lin.r[first + i] * s_[first + i], 2);
      if (!spring.rigid[i]) sum += std::pow(r[i] * s_[first + i], 2);
    }
  }
  for (Index i = 0; i < nl_; ++i) sum += std::pow(lin.e[i] * s_[n_ + i], 2);
  return std::sqrt(std::max(sum, 0.0));
}

}  // namespace stiffmap
