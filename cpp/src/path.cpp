// SPDX-License-Identifier: MIT
#include "stiffmap/path.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double tolerance = 1e-10;   // last Newton step, in multiples of the mechanism's length
constexpr double trusted_step = 0.1;  // of a Newton step: further may be another branch
constexpr double trusted_shrinking = 0.3;
constexpr int most_iterations = 15;
constexpr int bisections = 36;
constexpr double shortest_share = 1.0 / 1024;  // of the first step
constexpr double limit_share = 1e-4;           // load's part in the mode of a limit point

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

/// An equilibrium and its load.
struct Equilibrium {
  State state;
  double load = 0, along = 0;
  int unstable = 0;
};

/// One more equation besides equilibrium: row . (unknowns, load) = value, in scaled unknowns.
struct Constraint {
  PathControl control;
  double target = 0;  ///< load or displacement
  VecX row;           ///< arc: tangent of the last point
};

/// Newton on the bordered tangent, which stays regular at limit points.
class Follower {
 public:
  Follower(const Mechanism& m, const NodePoint& point, const Vec3& direction)
      : m_(m), point_(point), d_(direction), ws_(m), J_(6, m.size()), size_(m.size() + m.closures()) {
    force_.setZero(m.size());
    B_.setZero(size_ + 1, size_ + 1);
    rhs_.setZero(size_ + 1);
  }

  Status start(const PoseInput& in, Equilibrium& at_rest, std::uint32_t& flags);
  bool correct(const Constraint& c, Equilibrium& y);
  VecX tangent(const VecX& row);
  void move(Equilibrium& y, const VecX& step) const;
  VecX load_row() const { return VecX::Unit(size_ + 1, size_); }
  /// Displacement along the load per unit of a scaled step.
  double along(const VecX& step) const { return gradient_.dot(step.head(m_.size())); }
  PathPoint report(const Equilibrium& y) const;
  CriticalPoint critical(const Equilibrium& y) const;

 private:
  const Mechanism& m_;
  const NodePoint& point_;
  Vec3 d_;
  SolveWorkspace ws_;
  MatX J_, B_;
  Index size_;
  VecX force_, rhs_, gradient_;  ///< gradient of the displacement along the load, scaled unknowns
  Eigen::PartialPivLU<MatX> lu_;
  double load_unit_ = 1;  ///< N per unit of the scaled load
  Pose nominal_;

  void evaluate(Equilibrium& y);
  void border(const VecX& row);
};

void Follower::evaluate(Equilibrium& y) {
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

Status Follower::start(const PoseInput& in, Equilibrium& y, std::uint32_t& flags) {
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

void Follower::move(Equilibrium& y, const VecX& step) const {
  VecX v = step.head(size_);
  ws_.equilibrium.saddle.to_coordinates(v);
  y.state.z += v.head(m_.size());
  y.state.lambda += v.tail(m_.closures());
  y.load += load_unit_ * step[size_];
}

bool Follower::correct(const Constraint& c, Equilibrium& y) {
  SaddleSystem& saddle = ws_.equilibrium.saddle;
  const Linearization& lin = ws_.equilibrium.lin;
  VecX row = c.row, step;
  double previous = 0;
  for (int k = 0; k < most_iterations; ++k) {
    evaluate(y);
    force_balance(m_, lin, saddle, force_);
    rhs_.head(m_.size()) = force_;
    rhs_.segment(m_.size(), m_.closures()) = lin.e;
    VecX scaled = rhs_.head(size_);
    saddle.to_forces(scaled);
    rhs_.head(size_) = scaled;
    rhs_[size_] = 0;
    if (c.control == PathControl::force) {
      row = load_row();
      rhs_[size_] = (c.target - y.load) / load_unit_;
    } else if (c.control == PathControl::displacement) {
      row.setZero(size_ + 1);
      row.head(m_.size()) = load_unit_ * gradient_;
      rhs_[size_] = load_unit_ * (c.target - y.along);
    }
    border(row);
    step = lu_.solve(rhs_);
    VecX v = step.head(size_);
    saddle.to_coordinates(v);
    const double norm = saddle.step_norm(m_, v.head(m_.size()));
    if (!std::isfinite(norm) || norm > trusted_step) return false;
    if (k > 1 && norm > trusted_shrinking * previous && norm > 1e-7) return false;
    previous = norm;
    move(y, step);
    if (norm > tolerance || std::abs(load_unit_ * step[size_]) > 1e-9 * (std::abs(y.load) + load_unit_)) continue;
    evaluate(y);
    saddle.factorize();
    MatX A = 0.5 * (saddle.matrix() + saddle.matrix().transpose());
    const Index closures = saddle.regular() ? saddle.closures() : saddle.closure_rank();
    y.unstable = static_cast<int>(std::max<Index>(0, symmetric_inertia(A, 1e-14).negative - closures));
    // Closure errors that no step mends: the path would need a motion that is rigid.
    return lin.e.size() == 0 || lin.e.cwiseAbs().maxCoeff() < 1e-8 * m_.length;
  }
  return false;
}

/// Direction of the path at the last point corrected: unit length, forwards as seen by `row`.
VecX Follower::tangent(const VecX& row) {
  border(row);
  return lu_.solve(load_row()).normalized();
}

PathPoint Follower::report(const Equilibrium& y) const {
  const Linearization& lin = ws_.equilibrium.lin;
  PathPoint out;
  out.load = y.load;
  out.along = y.along;
  const Pose& T = lin.frames.at(point_.node);
  out.displacement << T * point_.offset - nominal_.p, log_so3(T.R * nominal_.R.transpose());
  out.x = lin.x;
  out.unstable = y.unstable;
  return out;
}

/// The mode is the eigenvector of the tangent for the eigenvalue nearest zero that moves something.
CriticalPoint Follower::critical(const Equilibrium& y) const {
  const SaddleSystem& saddle = ws_.equilibrium.saddle;
  const Index n = m_.size();
  const Eigen::SelfAdjointEigenSolver<MatX> eigen(0.5 * (saddle.matrix() + saddle.matrix().transpose()));
  Index best = -1;
  for (Index i = 0; i < size_; ++i) {
    if (eigen.eigenvectors().col(i).head(n).norm() < 1e-3) continue;
    if (best < 0 || std::abs(eigen.eigenvalues()[i]) < std::abs(eigen.eigenvalues()[best])) best = i;
  }
  CriticalPoint out;
  out.load = y.load;
  out.along = y.along;
  out.x = ws_.equilibrium.lin.x;
  VecX v = eigen.eigenvectors().col(best);
  out.limit = std::abs(gradient_.dot(v.head(n))) > limit_share * gradient_.norm() * v.head(n).norm();
  saddle.to_coordinates(v);
  out.mode = v.head(n).cwiseProduct(ws_.equilibrium.lin.da);
  double largest = 0;
  for (Index j = 0; j < n; ++j)
    if (std::abs(out.mode[j]) * m_.unit(j) > std::abs(largest)) largest = out.mode[j] * m_.unit(j);
  if (largest != 0) out.mode /= largest;
  return out;
}

/// Steps along a path: `step(share)` is a corrected point at that share of the present step.
class Path {
 public:
  Path(Follower& follower, const PathOptions& options, PathResult& out) : f_(follower), o_(options), out_(out) {}

  /// Accepts a point, after locating what happened on the way to it.
  template <class Step>
  void accept(const Equilibrium& from, Equilibrium& to, double share, const Step& step) {
    if (from.unstable != to.unstable) locate(from, to, share, step);
    out_.points.push_back(f_.report(to));
  }

 private:
  Follower& f_;
  const PathOptions& o_;
  PathResult& out_;

  template <class Step>
  void locate(const Equilibrium& from, Equilibrium& to, double share, const Step& step) {
    double low = 0, high = share;
    Equilibrium y = to, last = to;
    for (int k = 0; k < bisections; ++k) {
      const double middle = 0.5 * (low + high);
      if (!step(from, middle, y)) break;
      last = y;
      (y.unstable == from.unstable ? low : high) = middle;
    }
    CriticalPoint c = f_.critical(last);
    c.before = from.unstable;
    c.after = to.unstable;
    out_.critical.push_back(c);
    step(from, share, to);  // the linearisation belongs to the accepted point again
  }
};

/// Load or displacement in equal steps, halved where Newton does not trust them.
Status by_control(Follower& f, const PathOptions& o, Equilibrium y, PathResult& out) {
  Path path(f, o, out);
  const bool force = o.control == PathControl::force;
  for (int k = 1; k <= o.steps; ++k) {
    const double goal = o.limit * k / o.steps;
    double share = 1;
    for (;;) {
      const double start = force ? y.load : y.along, rest = goal - start;
      const auto step = [&](const Equilibrium& from, double s, Equilibrium& to) {
        to = from;
        return f.correct({o.control, start + s * rest, {}}, to);
      };
      Equilibrium next = y;
      if (!step(y, share, next)) {
        share *= 0.5;
        if (share < shortest_share) return Status::not_converged;
        continue;
      }
      const bool there = share == 1;
      path.accept(y, next, share, step);
      if (!there) out.points.pop_back();  // only the asked points are listed
      y = next;
      if (there) break;
      share = std::min(1.0, 2 * share);
    }
  }
  return Status::converged;
}

Status by_arc(Follower& f, const PathOptions& o, Equilibrium y, PathResult& out) {
  Path path(f, o, out);
  VecX tangent = f.tangent(f.load_row());
  if (o.limit < 0) tangent = -tangent;
  const double speed = std::abs(f.along(tangent));
  if (!(speed > 0)) return Status::not_converged;
  const double longest = std::abs(o.limit) / o.steps / speed;
  double length = longest;
  while (static_cast<int>(out.points.size()) < o.most_points) {
    const auto step = [&](const Equilibrium& from, double s, Equilibrium& to) {
      to = from;
      f.move(to, s * tangent);
      return f.correct({PathControl::arc, 0, tangent}, to);
    };
    Equilibrium next = y;
    if (!step(y, length, next)) {
      length *= 0.5;
      if (length < shortest_share * longest) return Status::not_converged;
      // the scaling of the next prediction belongs to the last accepted point
      f.correct({PathControl::force, y.load, {}}, y);
      continue;
    }
    path.accept(y, next, length, step);
    y = next;
    if (std::abs(y.along) >= std::abs(o.limit)) return Status::converged;
    tangent = f.tangent(tangent);
    length = std::min(1.5 * length, longest);
  }
  return Status::not_converged;
}

}  // namespace

PathResult follow_path(const Mechanism& m, const PoseInput& in, const Vec3& direction, const PathOptions& options) {
  PathResult out;
  Follower f(m, m.points[at(in.read_points.front())], direction);
  Equilibrium rest{State(m)};
  out.status = f.start(in, rest, out.flags);
  if (out.status != Status::converged) return out;
  out.points.push_back(f.report(rest));
  out.status = options.control == PathControl::arc ? by_arc(f, options, rest, out) : by_control(f, options, rest, out);
  return out;
}

}  // namespace stiffmap
