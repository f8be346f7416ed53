// SPDX-License-Identifier: MIT
#include "stiffmap/motion.hpp"

#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double closed = 1e-12;          // relative to the mechanism's length
constexpr double sound_pivot = 1e-8;      // of the normal matrix: below it, the rank is revealed
constexpr double nearest = 0.3;           // of the length: a last pose within it is a start
constexpr double shortest_stride = 0.02;  // of the way from home
constexpr double shortest_step = 0.05;    // of the way from a start

/// Rows of angles as lengths.
template <class Matrix>
void scale_angles(const Mechanism& m, Matrix&& rows) {
  for (Index i = 3; i < rows.rows(); i += 6) rows.middleRows(i, 3) *= m.length;
}

}  // namespace

RigidTree::RigidTree(const Mechanism& m) {
  std::vector<bool> moves(at(m.size()), false), kept(m.nodes.size(), false);
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.role != Role::actuator && (c.role != Role::passive || c.locked)) continue;
    moves[at(j)] = true;
    moving_.push_back(j);
  }
  const auto chosen = [&](const std::vector<Index>& path, std::size_t from) {
    std::vector<Index> out;
    for (std::size_t i = from; i < path.size(); ++i)
      if (moves[at(path[i])]) out.push_back(path[i]);
    return out;
  };
  kept[0] = true;
  kept[at(m.tip)] = true;
  tip_ = chosen(m.path[at(m.tip)], 0);
  for (const Loop& l : m.loops) {
    kept[at(l.primary)] = kept[at(l.end)] = true;
    const auto &a = m.path[at(l.primary)], &b = m.path[at(l.end)];
    std::size_t shared = 0;
    while (shared < a.size() && shared < b.size() && a[shared] == b[shared]) ++shared;
    loops_.push_back({chosen(a, shared), chosen(b, shared)});
  }
  std::vector<Pose> since(m.nodes.size());  // the kept frame behind each frame, and the transform from it
  std::vector<Index> behind(m.nodes.size(), 0);
  for (std::size_t i = 1; i < m.nodes.size(); ++i) {
    const Node& n = m.nodes[i];
    const std::size_t parent = at(n.parent);
    behind[i] = kept[parent] ? n.parent : behind[parent];
    since[i] = (kept[parent] ? Pose{} : since[parent]) * n.nominal;
    const bool moving = n.coordinate >= 0 && moves[at(n.coordinate)];
    if (n.coordinate >= 0 && !moving && m.coordinates[at(n.coordinate)].role != Role::spring) {
      const double held = m.home_coordinates[n.coordinate];
      if (n.type == JointType::prismatic) since[i].p += held * (since[i].R * n.axis);
      else since[i].R = (since[i].R * rotation_about(n.axis, held)).eval();
    }
    kept[i] = kept[i] || moving;
    if (kept[i])
      steps_.push_back({static_cast<Index>(i), behind[i], moving ? n.coordinate : -1, n.type, since[i], n.axis});
  }
}

void RigidTree::forward(const VecX& x, Frames& out) const {
  out.pose[0] = Pose{};
  for (const Step& s : steps_) {
    Pose& T = out.pose[at(s.node)];
    T = out.pose[at(s.parent)] * s.before;
    if (s.coordinate < 0) continue;
    const Vec3 w = T.R * s.axis;
    out.axis.col(s.coordinate) = w;
    out.origin.col(s.coordinate) = T.p;
    if (s.type == JointType::prismatic) T.p += x[s.coordinate] * w;
    else T.R = (T.R * rotation_about(s.axis, x[s.coordinate])).eval();
  }
}

LoopRates::LoopRates(const Mechanism& m) : tree_(m), J_(MatX::Zero(m.closures(), m.size())) {
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
  const Index n = static_cast<Index>(passive_.size());
  A_ = MatX::Zero(m.closures(), n);
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

/// A x, over the columns that each loop has.
MatX LoopRates::product(const MatX& x) const {
  MatX out = MatX::Zero(A_.rows(), x.cols());
  for (std::size_t l = 0; l < columns_.size(); ++l) {
    const Index row = 6 * static_cast<Index>(l);
    for (Index k : columns_[l])
      for (Index c = 0; c < x.cols(); ++c) out.col(c).segment<6>(row) += x(k, c) * A_.col(k).segment<6>(row);
  }
  return out;
}

/// A' e.
MatX LoopRates::transposed_product(const MatX& e) const {
  MatX out = MatX::Zero(A_.cols(), e.cols());
  for (std::size_t l = 0; l < columns_.size(); ++l) {
    const Index row = 6 * static_cast<Index>(l);
    for (Index k : columns_[l])
      for (Index c = 0; c < e.cols(); ++c) out(k, c) += A_.col(k).segment<6>(row).dot(e.col(c).segment<6>(row));
  }
  return out;
}

/// Least squares; one correction with the residual makes up for the squared condition of the normal matrix.
MatX LoopRates::solve_scaled(const MatX& e) const {
  if (!regular_) return cod_.solve(e);
  MatX x = llt_.solve(transposed_product(e));
  x += llt_.solve(transposed_product(e - product(x)));
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
    out.misfit = (product(x) + B).cwiseAbs().maxCoeff() / size;
    for (std::size_t k = 0; k < passive_.size(); ++k)
      out.rates.row(passive_[k]) = x.row(static_cast<Index>(k)) / m.unit(passive_[k]);
  }
  out.J.setZero(6, drives);
  for (Index j : tree_.tip()) out.J.noalias() += column(m, frames, j, frames.at(m.tip).p) * out.rates.row(j);
  out.pivot = pivot_;
  out.free_twist.setConstant(nan);
  if (regular_ || passive_.empty()) return;
  // With the drives held: the null direction that moves the tip most.
  const Index n = A_.cols(), rank = cod_.rank();
  if (rank == n) return;
  const MatX Z = (cod_.colsPermutation() * cod_.matrixZ().transpose().rightCols(n - rank)).eval();
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

PoseCloser::PoseCloser(const Mechanism& m)
    : ws_(m), tree_(m), e_(VecX::Zero(6 + m.closures())), last_(VecX::Zero(m.size())), trial_(VecX::Zero(m.size())) {
  std::vector<Index> place(at(m.size()), -1);
  const auto& moving = tree_.moving();
  const Index n = static_cast<Index>(moving.size());
  unit_.resize(n);
  for (Index k = 0; k < n; ++k) {
    place[at(moving[at(k)])] = k;
    unit_[k] = m.unit(moving[at(k)]);
  }
  const auto columns_of = [&](std::initializer_list<const std::vector<Index>*> paths) {
    std::vector<Index> used;
    for (const auto* path : paths)
      for (Index j : *path) used.push_back(place[at(j)]);
    std::sort(used.begin(), used.end());
    columns_.push_back(used);
  };
  columns_of({&tree_.tip()});
  for (std::size_t l = 0; l < m.loops.size(); ++l) columns_of({&tree_.loop(l)[0], &tree_.loop(l)[1]});
  A_ = MatX::Zero(6 + m.closures(), n);
  N_.resize(n, n);
  right_.resize(n);
}

double PoseCloser::residual(const Mechanism& m, const Pose& pose, const VecX& x) {
  tree_.forward(x, ws_.frames);
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

/// Normal matrix and right side of the equations at the frames; only columns that a loop has are touched.
void PoseCloser::normal(const Mechanism& m, const Pose& pose) {
  const auto& moving = tree_.moving();
  const auto put = [&](Index k, Index row, double sign, const Vec3& p) {
    Vec6 c = sign / unit_[k] * column(m, ws_.frames, moving[at(k)], p);
    c.tail<3>() *= m.length;
    A_.col(k).segment<6>(row) = c;
  };
  for (Index k : columns_[0]) put(k, 0, 1.0, ws_.frames.at(m.tip).p);
  if (m.task != full_task) {
    A_.middleRows<3>(3) = (pose.R.transpose() * A_.middleRows<3>(3)).eval();
    for (int i = 0; i < 6; ++i)
      if (!m.task[static_cast<std::size_t>(i)]) A_.row(i).setZero();
  }
  for (std::size_t l = 0; l < m.loops.size(); ++l) {
    const Index row = 6 + 6 * static_cast<Index>(l);
    for (std::size_t side = 0; side < 2; ++side) {
      const Vec3& p = ws_.frames.at(side ? m.loops[l].end : m.loops[l].primary).p;
      for (Index j : tree_.loop(l)[side]) {
        const auto k = std::lower_bound(moving.begin(), moving.end(), j) - moving.begin();
        put(static_cast<Index>(k), row, side ? 1.0 : -1.0, p);
      }
    }
  }
  N_.setZero();
  right_.setZero();
  for (std::size_t l = 0; l < columns_.size(); ++l) {
    const auto rows = A_.middleRows<6>(6 * static_cast<Index>(l));
    const Vec6 e = e_.segment<6>(6 * static_cast<Index>(l));
    const auto& used = columns_[l];
    for (std::size_t a = 0; a < used.size(); ++a) {
      const Vec6 c = rows.col(used[a]);
      right_[used[a]] += c.dot(e);
      for (std::size_t b = 0; b <= a; ++b) N_(used[a], used[b]) += c.dot(rows.col(used[b]));
    }
  }
}

/// Undamped and trusted only while its steps shrink fast, so that the answer continues the start.
bool PoseCloser::newton(const Mechanism& m, const Pose& pose, VecX& x) {
  double error = residual(m, pose, x), previous = 0;
  for (int k = 0; k < 8; ++k) {
    if (!std::isfinite(error)) return false;
    if (error < closed) return true;
    normal(m, pose);
    llt_.compute(N_);
    if (llt_.info() != Eigen::Success) return false;
    const VecX step = llt_.solve(right_);
    const double norm = step.norm() / m.length;
    if (!(norm < 0.3) || (k > 0 && norm > 0.25 * previous && norm > 1e-9)) return false;
    const auto& moving = tree_.moving();
    for (std::size_t u = 0; u < moving.size(); ++u)
      x[moving[u]] -= step[static_cast<Index>(u)] / unit_[static_cast<Index>(u)];
    previous = norm;
    error = residual(m, pose, x);
  }
  return error < closed;
}

double PoseCloser::pivot(const Mechanism& m, const Pose& pose) {
  normal(m, pose);
  llt_.compute(N_);
  if (llt_.info() != Eigen::Success) return 0;
  const auto pivots = llt_.matrixLLT().diagonal();
  return pivots.minCoeff() / pivots.maxCoeff();
}

/// Straight continuation from closed coordinates `x` at another pose, in leaps that may be halved to `shortest`.
bool PoseCloser::continued(const Mechanism& m, const Pose& from, const Pose& pose, double shortest, VecX& x) {
  const Vec3 turn = log_so3(pose.R * from.R.transpose());
  double done = 0, leap = 1;
  while (done < 1) {
    const double s = std::min(1.0, done + leap);
    const Pose way = s == 1 ? pose : Pose{from.p + s * (pose.p - from.p), exp_so3(s * turn) * from.R};
    trial_ = x;
    if (newton(m, way, trial_)) {
      x = trial_;
      done = s;
      leap *= 2;
    } else if ((leap *= 0.5) < shortest) {
      return false;
    }
  }
  return true;
}

bool PoseCloser::from_home(const Mechanism& m, const Pose& pose, VecX& x) {
  x = m.home_coordinates;
  return continued(m, m.home, pose, shortest_stride, x);
}

void PoseCloser::remember(const Pose& pose, const VecX& x) {
  if (has_last_) {
    const Vec3 step = pose.p - last_pose_.p;
    const bool same = (pose.R - last_pose_.R).cwiseAbs().maxCoeff() == 0 && step.norm() > 0;
    even_ = !same ? 0 : even_ > 0 && (step - step_).norm() < 1e-6 * step.norm() ? std::min(even_ + 1, 2) : 1;
    step_ = step;
    earlier_ = before_;
    before_ = last_;
  }
  last_ = x;
  last_pose_ = pose;
  has_last_ = true;
}

/// The parabola (or line) through the last poses.
bool PoseCloser::extrapolated(const Pose& pose, VecX& x) const {
  const Vec3 step = pose.p - last_pose_.p;
  if (even_ == 0 || (step - step_).norm() > 1e-6 * step.norm()) return false;
  if ((pose.R - last_pose_.R).cwiseAbs().maxCoeff() != 0) return false;
  if (even_ == 1) x = 2 * last_ - before_;
  else x = 3 * (last_ - before_) + earlier_;
  return true;
}

void PoseCloser::at_rest(const Mechanism& m, VecX& x) const {
  for (Index j = 0; j < m.size(); ++j)
    if (m.coordinates[at(j)].role == Role::spring) x[j] = 0;
    else if (m.coordinates[at(j)].role == Role::passive && m.coordinates[at(j)].locked) x[j] = m.home_coordinates[j];
}

ClosureResult PoseCloser::close(const Mechanism& m, const Pose& pose, VecX& x, bool patient) {
  ClosureResult out;
  const VecX given = x;
  bool ok = false;
  if (pose.p.allFinite() && pose.R.allFinite()) {
    if (given.allFinite()) {
      at_rest(m, x);
      ok = newton(m, pose, x);
    }
    const bool near =
        has_last_ && (pose.p - last_pose_.p).norm() < nearest * m.length && (pose.R - last_pose_.R).norm() < nearest;
    if (!ok && near) {
      if (!extrapolated(pose, x)) x = last_;
      ok = newton(m, pose, x);
    }
    if (!ok) ok = from_home(m, pose, x);
    if (!ok && patient) {
      out = inverse_closure(m, pose, ws_, x);
      ok = out.status == Status::converged;
      if (ok) residual(m, pose, x);
    }
  }
  return answer(m, pose, x, ok, out);
}

ClosureResult PoseCloser::continue_from(const Mechanism& m, const Pose& pose, VecX& x) {
  bool ok = pose.p.allFinite() && pose.R.allFinite() && x.allFinite();
  if (ok) {
    at_rest(m, x);
    tree_.forward(x, ws_.frames);
    const Pose from = ws_.frames.at(m.tip);
    ok = continued(m, from, pose, shortest_step, x);
  }
  return answer(m, pose, x, ok, {});
}

ClosureResult PoseCloser::answer(const Mechanism& m, const Pose& pose, const VecX& x, bool ok, ClosureResult out) {
  if (!ok) {
    has_last_ = false;
    even_ = 0;
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
  remember(pose, x);
  return out;
}

}  // namespace stiffmap
