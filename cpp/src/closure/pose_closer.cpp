// SPDX-License-Identifier: MIT
#include "stiffmap/closure/pose_closer.hpp"

#include <algorithm>
#include <cmath>

#include "closing.hpp"
#include "stiffmap/kinematics/pull.hpp"

namespace stiffmap {
namespace {

constexpr double closed = 1e-12;              // relative to the mechanism's length
constexpr double round_off_alone = 3e-15;     // the same: needs no step
constexpr double last_step = 1e-8;            // its square, what it leaves, is round-off
constexpr double nearest = 0.3;               // of the length: a last pose within it is a start
constexpr double longest_closing_step = 0.1;  // relative to the length: farther ones may end at another configuration
constexpr double on_the_way = 1e-3;           // a step of a pose that is only passed: what it leaves is a good start
constexpr double shortest_stride = 0.02;      // leap, of the way from home or from a start

}  // namespace

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

/// Undamped and trusted only while its steps shrink fast, so that the answer continues the start. `passed`: nearly is
/// enough.
bool PoseCloser::newton(const Mechanism& m, const Pose& pose, VecX& x, bool passed) {
  if (m.redundancy > 0) return close_nearest(m, pose, x);
  double error = residual(m, pose, x), previous = 1;
  for (int k = 0; k < 8; ++k) {
    if (!std::isfinite(error)) return false;
    if (error < round_off_alone || (error < closed && previous < last_step)) return true;
    if (passed && previous < on_the_way) return true;
    if (unit_.size() == 0) return false;
    normal(m, pose);
    if (!cholesky_.compute(N_)) return false;
    VecX step;
    cholesky_.solve(right_, step);
    const double norm = step.norm() / m.length;
    if (k == 0) first_step_ = norm;
    if (!(norm < longest_closing_step) || (k > 0 && norm > 0.25 * previous && norm > 1e-9)) return false;
    const auto& moving = tree_.moving();
    for (std::size_t u = 0; u < moving.size(); ++u)
      x[moving[u]] -= step[static_cast<Index>(u)] / unit_[static_cast<Index>(u)];
    previous = norm;
    error = residual(m, pose, x);
  }
  return error < closed;
}

bool PoseCloser::close_nearest(const Mechanism& m, const Pose& pose, VecX& x) {
  closing::select_unknowns(m, true, ws_);
  const closing::Target target{&pose, m.task};
  int iterations = 0;
  const bool ok = closing::close(m, target, closing::Pace::contracting, ws_, x, iterations);
  return ok && residual(m, pose, x) < closed;
}

double PoseCloser::pivot(const Mechanism& m, const Pose& pose) {
  normal(m, pose);
  if (unit_.size() == 0 || !cholesky_.compute(N_)) return 0;
  const auto pivots = cholesky_.pivots();
  return pivots.minCoeff() / pivots.maxCoeff();
}

/// Straight continuation from closed coordinates `x` at another pose, in leaps that may be halved to `shortest_stride`.
bool PoseCloser::continued(const Mechanism& m, const Pose& from, const Pose& pose, VecX& x) {
  const Vec3 turn = log_so3(pose.R * from.R.transpose());
  double done = 0, leap = 1;
  while (done < 1) {
    const double s = std::min(1.0, done + leap);
    const Pose way = s == 1 ? pose : Pose{from.p + s * (pose.p - from.p), exp_so3(s * turn) * from.R};
    trial_ = x;
    first_step_ = 0;
    const bool reached = newton(m, way, trial_, s < 1);
    // As far as first steps are trusted, but for a part that keeps the next from failing.
    const double trusted = 0.8 * longest_closing_step / first_step_;
    leap *= reached ? std::min(2.0, trusted) : std::clamp(trusted, 0.25, 0.5);
    if (reached) {
      x = trial_;
      done = s;
    } else if (leap < shortest_stride) {
      return false;
    }
  }
  return true;
}

/// From where the coordinates `x` are.
bool PoseCloser::from_there(const Mechanism& m, const Pose& pose, VecX& x) {
  at_rest(m, x);
  tree_.forward(x, ws_.frames);
  const Pose from = ws_.frames.at(m.tip);
  return continued(m, from, pose, x);
}

bool PoseCloser::from_home(const Mechanism& m, const Pose& pose, VecX& x) {
  x = m.home_coordinates;
  return continued(m, m.home, pose, x);
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
    if (given.allFinite()) ok = from_there(m, pose, x);
    const bool near = has_last_ && distance(pose, last_pose_, m.length) < nearest * m.length;
    if (!ok && near) {
      ok = extrapolated(pose, x) && newton(m, pose, x);
      if (!ok) x = last_;
      ok = ok || continued(m, last_pose_, pose, x);
    }
    if (!ok) ok = from_home(m, pose, x);
    if (!ok && patient) {
      out = inverse_closure(m, pose, ws_, x, m.home_coordinates, m.home);  // a motion goes on, it does not turn round
      ok = out.status == Status::converged;
      if (ok) residual(m, pose, x);
    }
  }
  return answer(m, pose, x, ok, out);
}

ClosureResult PoseCloser::continue_from(const Mechanism& m, const Pose& pose, VecX& x) {
  const bool ok = pose.p.allFinite() && pose.R.allFinite() && x.allFinite() && from_there(m, pose, x);
  return answer(m, pose, x, ok, {});
}

ClosureResult PoseCloser::answer(const Mechanism& m, const Pose& pose, VecX& x, bool ok, ClosureResult out) {
  if (!ok) {
    has_last_ = false;
    even_ = 0;
    out.status = Status::unreachable;
    return out;
  }
  out.status = Status::converged;
  out.tip = ws_.frames.at(m.tip);
  if (!m.cables.empty()) {
    forward(m, Geometry::nominal, x, ws_.frames);
    wind(m, ws_.frames, x);
  }
  out.flags = (out.flags & flag::branch_unverified) | closing::limits_met(m, x);
  remember(pose, x);
  return out;
}

}  // namespace stiffmap
