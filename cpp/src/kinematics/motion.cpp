// SPDX-License-Identifier: MIT
#include "stiffmap/kinematics/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stiffmap/kinematics/pull.hpp"

namespace stiffmap {
namespace {

constexpr double sound_pivot = 1e-8;   // of the normal matrix: below it, the rank is revealed
constexpr double not_together = 1e-7;  // loop velocity per rate of the drives, below which they go together

/// Equations between rates: those of the loops, then one per cable; in blocks of six.
Index equations(const Mechanism& m) { return m.closures() + 6 * ((static_cast<Index>(m.cables.size()) + 5) / 6); }

}  // namespace

LoopRates::LoopRates(const Mechanism& m) : tree_(m), J_(MatX::Zero(equations(m), m.size())) {
  std::vector<Index> place(at(m.size()), -1);
  for (Index j : tree_.moving()) {
    if (m.coordinates[at(j)].role != Role::passive) continue;
    place[at(j)] = static_cast<Index>(passive_.size());
    passive_.push_back(j);
  }
  for (std::size_t l = 0; l < m.loops.size(); ++l) {
    std::vector<Index> used;
    for (const auto& side : tree_.loop(l))
      for (Index j : side)
        if (place[at(j)] >= 0) used.push_back(place[at(j)]);
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    columns_.push_back(used);
  }
  std::vector<Index> all(passive_.size());
  std::iota(all.begin(), all.end(), Index{0});
  for (Index row = m.closures(); row < J_.rows(); row += 6) columns_.push_back(all);
  const Index n = static_cast<Index>(passive_.size());
  A_ = MatX::Zero(J_.rows(), n);
  N_.resize(n, n);
}

void LoopRates::factorise(const Mechanism& m, const Frames& frames) {
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    const Loop& loop = m.loops[i];
    const Index row = 6 * static_cast<Index>(i);
    for (std::size_t side = 0; side < 2; ++side) {
      const double sign = side ? 1.0 : -1.0;
      const Vec3& p = frames.at(side ? loop.end : loop.primary).p;
      for (Index j : tree_.loop(i)[side]) {
        Vec6 c = sign * column(m, frames, j, p);
        c.tail<3>() *= m.length;
        J_.col(j).segment<6>(row) = c;
      }
    }
    for (Index k : columns_[i])
      A_.col(k).segment<6>(row) = J_.col(passive_[at(k)]).segment<6>(row) / m.unit(passive_[at(k)]);
  }
  for (std::size_t i = 0; i < m.cables.size(); ++i) {
    const NodeSpring& s = m.external_springs[at(m.cables[i])];
    const Index row = m.closures() + static_cast<Index>(i);
    const Vec3 p = frames.point(s.node, s.offset);
    const Vec3 along = commanded_slope(s) * cable_line(s.anchor, s.winch->axis, s.winch->radius, p).along;
    J_.row(row).setZero();
    for (Index j : m.path[at(s.node)]) J_(row, j) = along.dot(column(m, frames, j, p).head<3>());
    J_(row, s.coordinate) = -1;
    for (std::size_t k = 0; k < passive_.size(); ++k)
      A_(row, static_cast<Index>(k)) = J_(row, passive_[k]) / m.unit(passive_[k]);
  }
  pivot_ = passive_.empty() ? 1.0 : fill_normal();
  regular_ = pivot_ > sound_pivot;
  if (!regular_) {
    orthogonal_.compute(A_, rank_threshold);
  }
}

/// Normal matrix and its Cholesky factor; returns the smallest pivot relative to its diagonal.
double LoopRates::fill_normal() {
  N_.setZero();
  for (std::size_t l = 0; l < columns_.size(); ++l) {
    const auto rows = A_.middleRows<6>(6 * static_cast<Index>(l));
    const auto& used = columns_[l];
    for (std::size_t a = 0; a < used.size(); ++a)
      for (std::size_t b = 0; b <= a; ++b) N_(used[a], used[b]) += rows.col(used[a]).dot(rows.col(used[b]));
  }
  if (!cholesky_.compute(N_)) return 0;
  double smallest = 1;
  for (Index k = 0; k < N_.rows(); ++k) {
    const double d = cholesky_.pivots()[k];
    smallest = std::min(smallest, d * d / std::max(N_(k, k), 1e-300));
  }
  return smallest;
}

/// Least squares; one correction with the residual makes up for the squared condition of the normal matrix.
MatX LoopRates::solve_scaled(const MatX& e) const {
  MatX x, correction;
  if (!regular_) {
    orthogonal_.solve(e, x);
    return x;
  }
  cholesky_.solve(A_.transpose().lazyProduct(e), x);
  cholesky_.solve(A_.transpose().lazyProduct(e - A_.lazyProduct(x)), correction);
  x += correction;
  return x;
}

void LoopRates::solve(const Mechanism& m, const MatX& e, Eigen::Ref<MatX> out) const {
  out.setZero();
  MatX scaled = MatX::Zero(A_.rows(), e.cols());
  scaled.topRows(e.rows()) = e;
  scale_angles(m, scaled.topRows(e.rows()));
  MatX x = MatX::Zero(A_.cols(), e.cols()), left = scaled;
  if (!passive_.empty()) {
    x = solve_scaled(scaled);
    left -= A_.lazyProduct(x);
  }
  if (!m.drives.empty() && left.norm() > not_together * scaled.norm()) {  // drives that go together move along
    const MatX B = driven(m);
    MatX open = B, y;
    if (!passive_.empty()) open += A_ * solve_scaled(-B);
    Orthogonal rates;
    rates.compute(open, not_together);
    rates.solve(left, y);
    if (!passive_.empty()) x = solve_scaled(scaled - B * y);
    for (std::size_t d = 0; d < m.drives.size(); ++d) {
      const Index j = m.drives[d].coordinate;
      out.row(j) = y.row(static_cast<Index>(d)) / m.unit(j);
    }
  }
  for (std::size_t k = 0; k < passive_.size(); ++k)
    out.row(passive_[k]) = x.row(static_cast<Index>(k)) / m.unit(passive_[k]);
}

/// Rates y of the drives (angles as lengths) go together where open y = 0, so that y = V v. By the weights W the
/// nearest to any are V (V'WV)^-1 V'W (theory D10).
void LoopRates::share(const Mechanism& m, const MatX& open, const VecX& weights, Motion& out) const {
  const Index drives = open.cols();
  out.together = drives;
  out.sharing.setIdentity(drives, drives);
  if (drives == 0 || open.rows() == 0 || open.cwiseAbs().maxCoeff() < not_together) return;
  const Singular parts = singular_vectors(open);
  out.together = drives - (parts.values.array() > not_together).count();
  out.sharing.setZero();
  if (out.together == 0) return;
  VecX W(drives);
  for (Index d = 0; d < drives; ++d) {
    const double unit = m.unit(m.drives[at(d)].coordinate);
    W[d] = weights.size() ? weights[d] / (unit * unit) : 1.0;
  }
  const MatX V = parts.V.rightCols(out.together), VW = V.transpose() * W.asDiagonal();
  MatX inner;
  Lu lu(out.together);
  lu.compute(VW * V);
  lu.solve(VW, inner);
  out.sharing.noalias() = V * inner;
  for (Index d = 0; d < drives; ++d) {
    const double unit = m.unit(m.drives[at(d)].coordinate);
    out.sharing.row(d) /= unit;
    out.sharing.col(d) *= unit;
  }
}

/// The loops' columns of the drives, angles as lengths.
MatX LoopRates::driven(const Mechanism& m) const {
  const Index drives = static_cast<Index>(m.drives.size());
  MatX B(J_.rows(), drives);
  for (Index d = 0; d < drives; ++d) {
    const Index j = m.drives[at(d)].coordinate;
    B.col(d) = J_.col(j) / m.unit(j);
  }
  return B;
}

void LoopRates::motion(const Mechanism& m, const Frames& frames, Motion& out, const VecX& weights) const {
  const Index drives = static_cast<Index>(m.drives.size());
  out.rates.setZero(m.size(), drives);
  const MatX B = driven(m);
  if (passive_.empty()) {
    share(m, B, weights, out);
  } else {
    MatX x = solve_scaled(-B);
    share(m, B + A_ * x, weights, out);
    for (Index d = 0; d < drives; ++d) x.col(d) *= m.unit(m.drives[at(d)].coordinate);
    for (std::size_t k = 0; k < passive_.size(); ++k)
      out.rates.row(passive_[k]) = x.row(static_cast<Index>(k)) / m.unit(passive_[k]) * out.sharing;
  }
  for (Index d = 0; d < drives; ++d) out.rates.row(m.drives[at(d)].coordinate) = out.sharing.row(d);
  out.J.setZero(6, drives);
  for (Index j : tree_.tip()) out.J.noalias() += column(m, frames, j, frames.at(m.tip).p) * out.rates.row(j);
  out.pivot = pivot_;
  out.free_twist.setConstant(nan);
  if (regular_ || passive_.empty()) return;
  // With the drives held: the null direction that moves the tip most.
  const Index n = A_.cols();
  if (orthogonal_.rank() == n) return;
  const MatX Z = orthogonal_.null_vectors();
  Mat6X tip = Mat6X::Zero(6, m.size()), T(6, n);
  for (Index j : tree_.tip()) tip.col(j) = column(m, frames, j, frames.at(m.tip).p);
  for (std::size_t k = 0; k < passive_.size(); ++k)
    T.col(static_cast<Index>(k)) = tip.col(passive_[k]) / m.unit(passive_[k]);
  const Mat6X moved = T * Z;
  Index most = 0;
  Mat6X sized = moved;
  sized.bottomRows<3>() *= m.length;
  if (sized.colwise().norm().maxCoeff(&most) > 1e-6) out.free_twist = moved.col(most) / sized.col(most).norm();
}

}  // namespace stiffmap
