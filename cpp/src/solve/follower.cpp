// SPDX-License-Identifier: MIT
#include "stiffmap/solve/follower.hpp"

#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double tolerance = 1e-10;   // last Newton step, in multiples of the mechanism's length
constexpr double trusted_step = 0.1;  // of a Newton step: further may be another branch
constexpr double trusted_shrinking = 0.3;
constexpr int most_iterations = 15;
constexpr double limit_share = 1e-4;  // load's part in the mode of a limit point
constexpr double noise = 1e-9;        // of the Jacobian: no motion along the load at all
constexpr double same_load = 1e-7;    // eigenvalues (scaled tangent) of modes that buckle together

/// Null vector of the tangent, scaled unknowns: of the eigenvectors that move something the one for the
/// eigenvalue nearest zero. Of several that buckle together, the combination that moves one coordinate most.
VecX critical_mode(const SaddleSystem& saddle, const Mechanism& m) {
  const Index n = m.size();
  const EigenX eigen = symmetric_eigen(MatX(0.5 * (saddle.matrix() + saddle.matrix().transpose())));
  const MatX& V = eigen.vectors;
  const VecX size = eigen.values.cwiseAbs();
  const auto moves = [&](Index i) { return V.col(i).head(n).norm() >= 1e-3; };
  Index best = -1;
  for (Index i = 0; i < size.size(); ++i)
    if (moves(i) && (best < 0 || size[i] < size[best])) best = i;
  MatX together(V.rows(), 0);
  for (Index i = 0; i < size.size(); ++i)
    if (i == best || (moves(i) && size[i] < std::max(same_load, 3 * size[best]))) {
      together.conservativeResize(Eigen::NoChange, together.cols() + 1);
      together.rightCols<1>() = V.col(i);
    }
  if (together.cols() == 1) return together;
  Index most = 0;
  double largest = -1;
  for (Index j = 0; j < n; ++j)
    if (const double arc = together.row(j).norm() * saddle.scale()[j] * m.unit(j); arc > largest) {
      largest = arc;
      most = j;
    }
  return (together * together.row(most).transpose()).normalized();
}

}  // namespace

Follower::Follower(const Mechanism& m, const NodePoint& point, const Vec3& direction)
    : m_(m), point_(point), d_(direction), ws_(m), J_(6, m.size()), size_(m.size() + m.closures()) {
  force_.setZero(m.size());
  B_.setZero(size_ + 1, size_ + 1);
  rhs_.setZero(size_ + 1);
}

void Follower::evaluate(LoadedState& y) {
  EquilibriumWorkspace& eq = ws_.equilibrium;
  ws_.problem.wrenches.back() << y.load * d_, Vec3::Zero();
  linearize(m_, ws_.problem, y.state, eq.lin);
  eq.saddle.assemble(m_, eq.lin);
  y.along = d_.dot(eq.lin.frames.point(point_.node, point_.offset) - nominal_.p);
  eq.lin.point_jacobian(m_, point_.node, point_.offset, J_);
  eq.saddle.to_unknowns(eq.lin, J_);
  gradient_ = J_.topRows<3>().transpose() * d_;
}

void Follower::border(const VecX& row) {
  B_.topLeftCorner(size_, size_) = ws_.equilibrium.saddle.matrix();
  B_.col(size_).setZero();
  B_.col(size_).head(m_.size()) = -load_unit_ * gradient_;
  B_.row(size_) = row.transpose();
  lu_.compute(B_);
}

Status Follower::start(const PoseInput& in, LoadedState& y, std::uint32_t& flags) {
  const ClosureResult closure = prepare_pose(m_, in, ws_);
  flags = closure.flags;
  if (closure.status != Status::converged) return Status::unreachable;
  const EquilibriumResult eq = solve_equilibrium(m_, ws_.problem, {}, ws_.equilibrium, ws_.state);
  flags |= eq.flags;
  if (eq.status != Status::converged) return eq.status;
  nominal_ = ws_.nominal.at(point_.node) * Pose{point_.offset, Mat3::Identity()};
  ws_.problem.load_points.push_back({point_.node, point_.offset, LoadType::dead});
  ws_.problem.load_frames.push_back(nominal_.R);
  ws_.problem.wrenches.push_back(Vec6::Zero());
  y.state = ws_.state;
  evaluate(y);
  if (gradient_.norm() > 0) load_unit_ = 1 / gradient_.norm();
  return correct({PathControl::force, 0, {}}, y) ? Status::converged : Status::not_converged;
}

void Follower::move(LoadedState& y, const VecX& step) const {
  VecX v = step.head(size_);
  ws_.equilibrium.saddle.to_coordinates(v);
  y.state.z += v.head(m_.size());
  y.state.lambda += v.tail(m_.closures());
  y.load += load_unit_ * step[size_];
}

double Follower::motion(const VecX& step) const {
  VecX v = step.head(size_);
  ws_.equilibrium.saddle.to_coordinates(v);
  return ws_.equilibrium.saddle.step_norm(m_, v.head(m_.size()));
}

double Follower::apart(const LoadedState& a, const LoadedState& b) const {
  const VecX between = b.state.z - a.state.z;
  return ws_.equilibrium.saddle.step_norm(m_, between);
}

/// Right-hand side of the bordered system; `row` becomes its last row.
VecX Follower::residual(const Constraint& c, const LoadedState& y, VecX& row) {
  SaddleSystem& saddle = ws_.equilibrium.saddle;
  const Linearization& lin = ws_.equilibrium.lin;
  force_balance(m_, lin, saddle, force_);
  VecX scaled(size_);
  scaled << force_, lin.e;
  saddle.to_forces(scaled);
  rhs_ << scaled, 0;
  if (c.control == PathControl::force) {
    row = load_row();
    rhs_[size_] = (c.target - y.load) / load_unit_;
  } else if (c.control == PathControl::displacement) {
    row.setZero(size_ + 1);
    row.head(m_.size()) = load_unit_ * gradient_;
    rhs_[size_] = load_unit_ * (c.target - y.along);
  }
  return rhs_;
}

bool Follower::correct(const Constraint& c, LoadedState& y) {
  const Linearization& lin = ws_.equilibrium.lin;
  VecX row = c.row;
  double previous = 0;
  for (int k = 0; k < most_iterations; ++k) {
    evaluate(y);
    const VecX rhs = residual(c, y, row);
    border(row);
    VecX step;
    lu_.solve(rhs, step);
    const double norm = motion(step);
    if (!std::isfinite(norm) || norm > trusted_step) return false;
    if (k > 1 && norm > trusted_shrinking * previous && norm > 1e-7) return false;
    previous = norm;
    move(y, step);
    if (norm > tolerance || std::abs(load_unit_ * step[size_]) > 1e-9 * (std::abs(y.load) + load_unit_)) continue;
    evaluate(y);
    ws_.equilibrium.saddle.factorize();
    y.unstable = static_cast<int>(ws_.equilibrium.stability.falling(ws_.equilibrium.saddle));
    // Closure errors that no step mends: the path would need a motion that is rigid.
    return lin.e.size() == 0 || lin.e.cwiseAbs().maxCoeff() < 1e-8 * m_.length;
  }
  return false;
}

VecX Follower::tangent(const VecX& row) {
  border(row);
  VecX t;
  lu_.solve(load_row(), t);
  return t.normalized();
}

PathPoint Follower::report(const LoadedState& y) const {
  const Linearization& lin = ws_.equilibrium.lin;
  PathPoint out;
  out.load = y.load;
  out.along = y.along;
  const Pose& T = lin.frames.at(point_.node);
  out.displacement << T * point_.offset - nominal_.p, log_so3(T.R * nominal_.R.transpose());
  out.x = by_own_axes(m_, y.state.charts, lin.x, ws_.x);
  out.unstable = y.unstable;
  return out;
}

PathPoint Follower::report_again(LoadedState y) {
  evaluate(y);
  return report(y);
}

Crossing Follower::critical(const LoadedState& y) const {
  const SaddleSystem& saddle = ws_.equilibrium.saddle;
  const Index n = m_.size();
  Crossing out{{}, y, {}};
  CriticalPoint& p = out.point;
  p.load = y.load;
  p.along = y.along;
  p.x = by_own_axes(m_, y.state.charts, ws_.equilibrium.lin.x, ws_.x);
  VecX v = critical_mode(saddle, m_);
  const double gradient = std::max(gradient_.norm(), noise * J_.topRows<3>().norm());
  p.limit = std::abs(gradient_.dot(v.head(n))) > limit_share * gradient * v.head(n).norm();
  out.mode.setZero(size_ + 1);
  out.mode.head(size_) = v;
  saddle.to_coordinates(v);
  p.mode = v.head(n).cwiseProduct(ws_.equilibrium.lin.da);
  double largest = 0;
  for (Index j = 0; j < n; ++j)
    if (std::abs(p.mode[j]) * m_.unit(j) > std::abs(largest)) largest = p.mode[j] * m_.unit(j);
  if (largest != 0) {
    p.mode /= largest;
    out.mode *= m_.length / largest;
  }
  return out;
}

bool Follower::leave(const Crossing& from, double size, LoadedState& y) {
  y = from.at;
  evaluate(y);  // the scaling of the mode belongs to the critical point
  move(y, size * from.mode);
  return correct({PathControl::arc, 0, from.mode.normalized()}, y);
}

}  // namespace stiffmap
