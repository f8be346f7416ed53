// SPDX-License-Identifier: MIT
#include "stiffmap/equilibrium/floating.hpp"

#include <algorithm>
#include <cmath>

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/kinematics/pull.hpp"

namespace stiffmap {
namespace {

constexpr int most_descents = 400;
constexpr double longest_step = 0.1;    // of the length
constexpr double far_away = 0.2;        // of the length, from the command
constexpr double arrived = 1e-13;       // last step, of the length
constexpr double no_curvature = 1e-9;   // curvature of no stiffness, of the largest
constexpr double push_off = 1e-4;       // from a saddle, of the length
constexpr double sufficient = 1e-4;     // share of the slope's promise that a step has to keep
constexpr double energy_noise = 1e-14;  // of the energies that are summed up

/// The platform as one body: a frame that all free joints turn about, and what is fixed to it.
class Platform {
 public:
  Platform(const Mechanism& m, const Problem& p) : m_(m), p_(p), frames_(m), x_(p.base), free_(m.path[at(m.tip)]) {
    forward(m, Geometry::actual, x_, frames_);
    for (const Index j : free_) node_ = std::max(node_, m.coordinates[at(j)].node);
    home_ = now = frames_.at(node_);
    S_ = Mat6::Zero();
    for (const Index j : free_) {
      if (m.coordinates[at(j)].type == JointType::prismatic) S_.col(count_++).head<3>() = frames_.axis.col(j);
      else S_.col(count_++).tail<3>() = frames_.axis.col(j) / m.length, ++turns_;
    }
    if (turns_ == 3) {  // a ball: all rotations, whatever its axes are now
      Index k = 0;
      for (Index c = 0; c < count_; ++c)
        if (!S_.col(c).tail<3>().isZero(0)) S_.col(c).tail<3>() = Vec3::Unit(k++) / m.length;
    }
    const Pose back = home_.inverse();
    for (const NodeSpring& s : m.external_springs) points_.push_back(back * pulled_point(s, frames_));
    for (const NodeBody& b : m.bodies) centres_.push_back(back * frames_.point(b.node, b.com));
    for (const LoadPoint& l : p.load_points) loads_.push_back(back * frames_.point(l.node, l.offset));
  }

  Pose now;
  double energy = 0, noise = 0;
  Vec6 gradient;
  Mat6 tangent;  ///< of the gradient, base axes

  /// Energy of cables and gravity, less the work of the wrenches as `work` has them; and with `whole` its derivatives.
  void evaluate(bool whole) {
    energy = noise = 0;
    gradient.setZero();
    tangent.setZero();
    for (std::size_t i = 0; i < m_.external_springs.size(); ++i) {
      const NodeSpring& s = m_.external_springs[i];
      if (!moves(s.node)) continue;
      const Vec3 r = now.R * points_[i];
      const CableLine line = line_of(s, now.p + r);
      const Pull pull = pull_of(s, line.length, free_length(s, x_));
      energy += pull.energy;
      noise += pull.energy;
      if (whole)
        add(r, -pull.force * line.along, pull.stiffness * line.along * line.along.transpose() + pull.force * line.bend);
    }
    for (std::size_t i = 0; i < m_.bodies.size(); ++i) {
      if (!moves(m_.bodies[i].node)) continue;
      const Vec3 r = now.R * centres_[i], weight = p_.factor * m_.bodies[i].mass * p_.gravity;
      energy -= weight.dot(now.p + r - home_.p);
      noise += weight.norm() * m_.length;
      if (whole) add(r, weight, Mat3::Zero());
    }
    for (std::size_t i = 0; i < p_.load_points.size(); ++i) {
      if (!moves(p_.load_points[i].node) || p_.wrenches[i].isZero(0)) continue;
      const Vec3 r = now.R * loads_[i];
      const Mat3 turned = now.R * home_.R.transpose();
      if (whole) frozen_.push_back(p_.factor * p_.wrench_at(i, turned * frame_of(i)));
      const Vec6& w = frozen_[i];
      energy -= w.head<3>().dot(now.p + r - home_.p);
      noise += w.head<3>().norm() * m_.length;
      if (!whole) continue;
      add(r, w.head<3>(), Mat3::Zero());
      gradient.tail<3>() -= w.tail<3>();
      add_turning(i, r, w, turned);
    }
  }

  /// Work of the moments over a turn since the last linearisation.
  double work(const Vec6& step) const {
    double sum = 0;
    for (const Vec6& w : frozen_) sum += w.tail<3>().dot(step.tail<3>());
    return sum;
  }

  void linearize() {
    frozen_.clear();
    frozen_.reserve(p_.load_points.size());
    evaluate(true);
  }

  Index freedoms() const { return count_; }
  auto directions() const { return S_.leftCols(count_); }

  static Pose moved(const Pose& from, const Vec6& step) {
    return {from.p + step.head<3>(), exp_so3(step.tail<3>()) * from.R};
  }
  double away(double length) const { return distance(now, home_, length); }

  /// Coordinates of the free joints where the platform is now; `turned`: angle about a single axis.
  void coordinates(double turned, VecX& x) const {
    x = x_;
    Index first = -1;
    for (const Index j : free_) {
      if (m_.coordinates[at(j)].type == JointType::prismatic) x[j] += frames_.axis.col(j).dot(now.p - home_.p);
      else if (turns_ == 1) x[j] += turned;
      else if (first < 0) first = j;
    }
    if (first < 0) return;
    // The axes of a ball are those of a right-handed frame, in order: R = Rx(a) Ry(b) Rz(c).
    const Node& n = m_.nodes[at(m_.coordinates[at(first)].node)];
    const Mat3 R = (frames_.at(n.parent).R * n.actual.R).transpose() * now.R;
    const double b = std::asin(std::clamp(R(0, 2), -1.0, 1.0));
    const double whole = 2 * EIGEN_PI;
    const auto near = [&](double angle, Index j) { return angle + whole * std::round((x_[j] - angle) / whole); };
    x[first] = near(std::atan2(-R(1, 2), R(2, 2)), first);
    x[first + 1] = b;
    x[first + 2] = near(std::atan2(-R(0, 1), R(0, 0)), first + 2);
  }

 private:
  const Mechanism& m_;
  const Problem& p_;
  Frames frames_;
  const VecX& x_;
  const std::vector<Index>& free_;
  Index node_ = 0, count_ = 0, turns_ = 0;
  Pose home_;
  Mat6 S_;  ///< columns: twists of the free joints, rotations in lengths
  std::vector<Vec3> points_, centres_, loads_;
  std::vector<Vec6> frozen_;  ///< wrenches at the last linearisation

  bool moves(Index node) const { return !m_.path[at(node)].empty(); }

  Mat3 frame_of(std::size_t i) const { return i < p_.load_frames.size() ? p_.load_frames[i] : Mat3::Identity(); }

  /// A force f at arm r that changes by -K times the motion of its point.
  void add(const Vec3& r, const Vec3& f, const Mat3& K) {
    gradient.head<3>() -= f;
    gradient.tail<3>() -= r.cross(f);
    const Mat3 X = skew(r), KX = K * X;
    tangent.topLeftCorner<3, 3>() += K;
    tangent.topRightCorner<3, 3>() -= KX;
    tangent.bottomLeftCorner<3, 3>() += X * K;
    tangent.bottomRightCorner<3, 3>() += -X * KX + r.dot(f) * Mat3::Identity() - r * f.transpose();
  }

  /// What follows the platform changes as it turns: F by w x F.
  void add_turning(std::size_t i, const Vec3& r, const Vec6& w, const Mat3& turned) {
    const LoadType type = p_.load_points[i].type;
    if (type == LoadType::follower) {
      const Mat3 F = skew(Vec3(w.head<3>())), M = skew(Vec3(w.tail<3>()));
      tangent.topRightCorner<3, 3>() += F;
      tangent.bottomRightCorner<3, 3>() += M + skew(r) * F;
    } else if (type == LoadType::semitangential) {
      const Vec3 m = p_.factor * p_.wrenches[i].tail<3>();
      const Mat3& R = turned;
      const Vec3 trace(R(1, 2) - R(2, 1), R(2, 0) - R(0, 2), R(0, 1) - R(1, 0));
      tangent.bottomRightCorner<3, 3>() -= 0.5 * (m * trace.transpose() - R.transpose() * skew(m));
    }
  }
};

}  // namespace

FloatingResult find_floating(const Mechanism& m, const Problem& problem, VecX& x) {
  FloatingResult out;
  Platform body(m, problem);
  const Index n = body.freedoms();
  const auto S = body.directions();
  double turned = 0;
  Lu lu;
  for (out.iterations = 1; out.iterations <= most_descents; ++out.iterations) {
    body.linearize();
    const VecX g = S.transpose() * body.gradient;
    const MatX A = S.transpose() * body.tangent * S;
    const EigenX e = symmetric_eigen(MatX(0.5 * (A + A.transpose())));
    const double most = std::max(e.values.cwiseAbs().maxCoeff(), 1e-12 * m.stiffness);
    const bool definite = e.values[0] > no_curvature * most;
    VecX step;
    if (definite) {
      lu.compute(A);
      lu.solve(VecX(-g), step);
    }
    if (!definite || !(step.dot(g) < 0)) {
      step = VecX::Zero(n);
      for (Index k = 0; k < n; ++k) {
        const double slope = e.vectors.col(k).dot(g);
        step -= slope / std::max(std::abs(e.values[k]), no_curvature * most) * e.vectors.col(k);
      }
      if (step.norm() < 1e-7 * m.length && e.values[0] < -no_curvature * most)  // a saddle: off it, downhill
        step += (e.vectors.col(0).dot(g) > 0 ? -1 : 1) * push_off * m.length * e.vectors.col(0);
    }
    const double norm = step.norm();
    if (!std::isfinite(norm)) return out;
    if (norm > longest_step * m.length) step *= longest_step * m.length / norm;
    const double promise = -(g.dot(step) + 0.5 * std::min(0.0, step.dot(A * step)));
    const Pose from = body.now;
    const double before = body.energy;
    const bool whisper = promise < energy_noise * body.noise;
    double share = 1;
    for (;; share *= 0.5) {
      const Vec6 twist = share * (S * step);
      body.now = Platform::moved(from, twist);
      if (whisper) break;
      body.evaluate(false);
      if (body.energy - body.work(twist) <= before - sufficient * share * promise) break;
      if (share < 1e-12) break;
    }
    for (Index k = 0; k < n; ++k)
      if (m.coordinates[at(m.path[at(m.tip)][at(k)])].type == JointType::revolute) turned += share * step[k] / m.length;
    if (norm < arrived * m.length || (whisper && norm < 1e-11 * m.length)) {
      out.found = true;
      break;
    }
  }
  out.leapt = body.away(m.length) > far_away * m.length;
  body.coordinates(turned, x);
  return out;
}

}  // namespace stiffmap
