// SPDX-License-Identifier: MIT
#include "stiffmap/motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stiffmap {
namespace {

constexpr double closed = 1e-12;        // relative to the mechanism's length
constexpr double sound_pivot = 1e-8;    // of the normal matrix: below it, the rank is revealed
constexpr double nearest = 0.3;         // of the length: a last pose within it is a start
constexpr double shortest_leap = 0.02;  // of the way from home
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

/// Rows of angles as lengths.
template <class Matrix>
void scale_angles(const Mechanism& m, Matrix&& rows) {
  for (Index i = 3; i < rows.rows(); i += 6) rows.middleRows(i, 3) *= m.length;
}

}  // namespace

LoopRates::LoopRates(const Mechanism& m) : J_(MatX::Zero(m.closures(), m.size())) {
  std::vector<Index> place(at(m.size()), -1);
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.role != Role::passive || c.locked) continue;
    place[at(j)] = static_cast<Index>(passive_.size());
    passive_.push_back(j);
  }
  for (const Loop& l : m.loops) {
    std::vector<Index> used;
    for (Index node : {l.primary, l.end})
      for (Index j : m.path[at(node)])
        if (place[at(j)] >= 0) used.push_back(place[at(j)]);
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    columns_.push_back(used);
  }
  const Index n = static_cast<Index>(passive_.size());
  A_.resize(m.closures(), n);
  N_.resize(n, n);
}

void LoopRates::factorise(const Mechanism& m, const Frames& frames) {
  J_.setZero();
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    const Loop& loop = m.loops[i];
    const Index row = 6 * static_cast<Index>(i);
    add_jacobian(m, frames, loop.end, frames.at(loop.end).p, 1.0, J_.middleRows<6>(row));
    add_jacobian(m, frames, loop.primary, frames.at(loop.primary).p, -1.0, J_.middleRows<6>(row));
  }
  scale_angles(m, J_);
  for (std::size_t k = 0; k < passive_.size(); ++k)
    A_.col(static_cast<Index>(k)) = J_.col(passive_[k]) / m.unit(passive_[k]);
  pivot_ = passive_.empty() ? 1.0 : fill_normal();
  regular_ = pivot_ > sound_pivot;
  if (!regular_) {
    cod_.setThreshold(rank_threshold);
    cod_.compute(A_);
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
  llt_.compute(N_);
  if (llt_.info() != Eigen::Success) return 0;
  double smallest = 1;
  for (Index k = 0; k < N_.rows(); ++k) {
    const double d = llt_.matrixLLT()(k, k);
    smallest = std::min(smallest, d * d / std::max(N_(k, k), 1e-300));
  }
  return smallest;
}

/// Least squares; one correction with the residual makes up for the squared condition of the normal matrix.
MatX LoopRates::solve_scaled(const MatX& e) const {
  if (!regular_) return cod_.solve(e);
  MatX x = llt_.solve(A_.transpose() * e);
  x += llt_.solve(A_.transpose() * (e - A_ * x));
  return x;
}

void LoopRates::solve(const Mechanism& m, const MatX& e, Eigen::Ref<MatX> out) const {
  out.setZero();
  if (passive_.empty()) return;
  MatX scaled = e;
  scale_angles(m, scaled);
  const MatX x = solve_scaled(scaled);
  for (std::size_t k = 0; k < passive_.size(); ++k)
    out.row(passive_[k]) = x.row(static_cast<Index>(k)) / m.unit(passive_[k]);
}

void LoopRates::motion(const Mechanism& m, const Frames& frames, Motion& out) const {
  const Index drives = static_cast<Index>(m.drives.size());
  out.rates.setZero(m.size(), drives);
  MatX B(m.closures(), drives);
  for (Index d = 0; d < drives; ++d) {
    const Index j = m.drives[at(d)].coordinate;
    B.col(d) = J_.col(j);
    out.rates(j, d) = 1;
  }
  out.misfit = 0;
  if (!passive_.empty()) {
    const MatX x = solve_scaled(-B);
    const double size = std::max(B.cwiseAbs().maxCoeff(), 1e-300);
    out.misfit = (A_ * x + B).cwiseAbs().maxCoeff() / size;
    for (std::size_t k = 0; k < passive_.size(); ++k)
      out.rates.row(passive_[k]) = x.row(static_cast<Index>(k)) / m.unit(passive_[k]);
  }
  Mat6X tip = Mat6X::Zero(6, m.size());
  add_jacobian(m, frames, m.tip, frames.at(m.tip).p, 1.0, tip);
  out.J.noalias() = tip * out.rates;
  out.pivot = pivot_;
  out.free_twist.setConstant(nan);
  if (regular_ || passive_.empty()) return;
  // With the drives held: the null direction that moves the tip most.
  const Index n = A_.cols(), rank = cod_.rank();
  if (rank == n) return;
  const MatX Z = (cod_.colsPermutation() * cod_.matrixZ().transpose().rightCols(n - rank)).eval();
  Mat6X T(6, n);
  for (std::size_t k = 0; k < passive_.size(); ++k)
    T.col(static_cast<Index>(k)) = tip.col(passive_[k]) / m.unit(passive_[k]);
  const Mat6X moved = T * Z;
  Index most = 0;
  Mat6X sized = moved;
  sized.bottomRows<3>() *= m.length;
  if (sized.colwise().norm().maxCoeff(&most) > 1e-6) out.free_twist = moved.col(most) / sized.col(most).norm();
}

PoseCloser::PoseCloser(const Mechanism& m)
    : ws_(m), e_(VecX::Zero(6 + m.closures())), last_(VecX::Zero(m.size())), trial_(VecX::Zero(m.size())) {
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.role == Role::actuator || (c.role == Role::passive && !c.locked)) unknown_.push_back(j);
  }
  const Index n = static_cast<Index>(unknown_.size());
  A_.resize(6 + m.closures(), n);
  N_.resize(n, n);
}

double PoseCloser::residual(const Mechanism& m, const Pose& pose, const VecX& x) {
  forward(m, Geometry::nominal, x, ws_.frames);
  e_.head<6>() = -frame_error(ws_.frames.at(m.tip), pose);
  if (m.task != full_task) {
    e_.segment<3>(3) = (pose.R.transpose() * e_.segment<3>(3)).eval();
    for (int i = 0; i < 6; ++i)
      if (!m.task[static_cast<std::size_t>(i)]) e_[i] = 0;
  }
  for (std::size_t i = 0; i < m.loops.size(); ++i)
    e_.segment<6>(6 + 6 * static_cast<Index>(i)) =
        frame_error(ws_.frames.at(m.loops[i].primary), ws_.frames.at(m.loops[i].end));
  scale_angles(m, e_);
  return e_.cwiseAbs().maxCoeff() / m.length;
}

/// Undamped and trusted only while its steps shrink fast, so that the answer continues the start.
bool PoseCloser::newton(const Mechanism& m, const Pose& pose, VecX& x) {
  double error = residual(m, pose, x), previous = 0;
  for (int k = 0; k < 8; ++k) {
    if (!std::isfinite(error)) return false;
    if (error < closed) return true;
    ws_.J.setZero();
    add_jacobian(m, ws_.frames, m.tip, ws_.frames.at(m.tip).p, 1.0, ws_.J.topRows<6>());
    if (m.task != full_task) {
      ws_.J.middleRows<3>(3) = (pose.R.transpose() * ws_.J.middleRows<3>(3)).eval();
      for (int i = 0; i < 6; ++i)
        if (!m.task[static_cast<std::size_t>(i)]) ws_.J.row(i).setZero();
    }
    for (std::size_t i = 0; i < m.loops.size(); ++i) {
      const Index row = 6 + 6 * static_cast<Index>(i);
      const Loop& loop = m.loops[i];
      add_jacobian(m, ws_.frames, loop.end, ws_.frames.at(loop.end).p, 1.0, ws_.J.middleRows<6>(row));
      add_jacobian(m, ws_.frames, loop.primary, ws_.frames.at(loop.primary).p, -1.0, ws_.J.middleRows<6>(row));
    }
    scale_angles(m, ws_.J);
    for (std::size_t u = 0; u < unknown_.size(); ++u)
      A_.col(static_cast<Index>(u)) = ws_.J.col(unknown_[u]) / m.unit(unknown_[u]);
    N_.noalias() = A_.transpose() * A_;
    const Eigen::LLT<MatX> llt(N_);
    if (llt.info() != Eigen::Success) return false;
    const VecX step = llt.solve(A_.transpose() * e_);
    const double norm = step.norm() / m.length;
    if (!(norm < 0.3) || (k > 0 && norm > 0.25 * previous && norm > 1e-9)) return false;
    for (std::size_t u = 0; u < unknown_.size(); ++u)
      x[unknown_[u]] -= step[static_cast<Index>(u)] / m.unit(unknown_[u]);
    previous = norm;
    error = residual(m, pose, x);
  }
  return error < closed;
}

/// Straight continuation from home.
bool PoseCloser::from_home(const Mechanism& m, const Pose& pose, VecX& x) {
  x = m.home_coordinates;
  const Vec3 turn = log_so3(pose.R * m.home.R.transpose());
  double done = 0, leap = 1;
  while (done < 1) {
    const double s = std::min(1.0, done + leap);
    const Pose way = s == 1 ? pose : Pose{m.home.p + s * (pose.p - m.home.p), exp_so3(s * turn) * m.home.R};
    trial_ = x;
    if (newton(m, way, trial_)) {
      x = trial_;
      done = s;
      leap *= 2;
    } else if ((leap *= 0.5) < shortest_leap) {
      return false;
    }
  }
  return true;
}

ClosureResult PoseCloser::close(const Mechanism& m, const Pose& pose, VecX& x, bool patient) {
  ClosureResult out;
  const VecX given = x;
  bool ok = false;
  if (pose.p.allFinite() && pose.R.allFinite()) {
    if (given.allFinite()) {
      for (Index j = 0; j < m.size(); ++j)
        if (m.coordinates[at(j)].role == Role::spring) x[j] = 0;
      ok = newton(m, pose, x);
    }
    const bool near =
        has_last_ && (pose.p - last_pose_.p).norm() < nearest * m.length && (pose.R - last_pose_.R).norm() < nearest;
    if (!ok && near) {
      x = last_;
      ok = newton(m, pose, x);
    }
    if (!ok) ok = from_home(m, pose, x);
    if (!ok && patient) {
      out = inverse_closure(m, pose, ws_, x);
      ok = out.status == Status::converged;
      if (ok) residual(m, pose, x);
    }
  }
  if (!ok) {
    has_last_ = false;
    out.status = Status::unreachable;
    return out;
  }
  out.status = Status::converged;
  out.tip = ws_.frames.at(m.tip);
  out.flags &= flag::branch_unverified;
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (x[j] >= c.lower && x[j] <= c.upper) continue;
    out.flags |= c.role == Role::actuator ? flag::drive_range : flag::joint_limit;
  }
  last_ = x;
  last_pose_ = pose;
  has_last_ = true;
  return out;
}

}  // namespace stiffmap
