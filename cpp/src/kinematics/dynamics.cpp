// SPDX-License-Identifier: MIT
#include "stiffmap/kinematics/dynamics.hpp"

#include <cmath>

namespace stiffmap {
namespace {

/// Velocity and acceleration of a frame's origin, angular ones of the frame.
struct Movement {
  Vec3 v = Vec3::Zero(), w = Vec3::Zero(), a = Vec3::Zero(), b = Vec3::Zero();

  Vec3 acceleration_at(const Vec3& arm) const { return a + b.cross(arm) + w.cross(w.cross(arm)); }
};

/// Movements of all frames at coordinate rates and accelerations, from the base outwards (theory D4).
std::vector<Movement> move(const Mechanism& m, const Frames& f, const VecX& rate, const VecX& acceleration) {
  std::vector<Movement> out(m.nodes.size());
  for (std::size_t i = 1; i < m.nodes.size(); ++i) {
    const Node& n = m.nodes[i];
    const Movement& parent = out[at(n.parent)];
    const Vec3 arm = f.pose[i].p - f.at(n.parent).p;
    Movement& now = out[i];
    now.w = parent.w;
    now.b = parent.b;
    now.v = parent.v + parent.w.cross(arm);
    now.a = parent.acceleration_at(arm);
    if (n.coordinate < 0) continue;
    const Vec3 axis = f.axis.col(n.coordinate);
    const double r = rate[n.coordinate], s = acceleration[n.coordinate];
    if (n.type == JointType::prismatic) {
      now.v += r * axis;
      now.a += s * axis + 2 * r * parent.w.cross(axis);
    } else {
      now.w += r * axis;
      now.b += s * axis + r * parent.w.cross(axis);
    }
  }
  return out;
}

/// Rows of a twist (or a Jacobian of it) that the task commands.
template <class Rows>
void mask(const Mechanism& m, const Mat3& R, Rows&& rows) {
  rows.template bottomRows<3>() *= m.length;
  if (m.task == full_task) return;
  rows.template bottomRows<3>() = (R.transpose() * rows.template bottomRows<3>()).eval();
  for (int i = 0; i < 6; ++i)
    if (!m.task[at(i)]) rows.row(i).setZero();
}

/// Adds J^T of a wrench at point p of `node` to the forces on the coordinates.
void add_force(const Mechanism& m, const Frames& f, Index node, const Vec3& p, const Vec6& w, VecX& out) {
  for (Index j : m.path[at(node)]) out[j] += column(m, f, j, p).dot(w);
}

/// Springs of passive joints and external springs: forces on the coordinates (against `out`), energy.
double add_springs(const Mechanism& m, const Frames& f, const VecX& x, VecX& out) {
  double energy = 0;
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (!c.from_home()) continue;
    const double k = m.laws[at(c.law)].stiffness(), d = x[j] - m.rest[j];
    out[j] += k * d;
    energy += 0.5 * k * d * d;
  }
  for (const NodeSpring& s : m.external_springs) {
    const Vec3 p = f.point(s.node, s.offset), d = p - s.anchor;
    const double length = d.norm(), stretch = length - s.length;
    if (length < 1e-12 || (s.tension_only && stretch <= 0)) continue;
    Vec6 w = Vec6::Zero();
    w.head<3>() = s.stiffness * stretch / length * d;
    add_force(m, f, s.node, p, w, out);
    energy += 0.5 * s.stiffness * stretch * stretch;
  }
  return energy;
}

/// Relative accelerations of the loops' ends at given movements.
VecX loop_accelerations(const Mechanism& m, const std::vector<Movement>& moved) {
  VecX out(m.closures());
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    const Movement &a = moved[at(m.loops[i].primary)], &b = moved[at(m.loops[i].end)];
    out.segment<6>(6 * static_cast<Index>(i)) << b.a - a.a, b.b - a.b;
  }
  return out;
}

}  // namespace

MatX coordinate_mass(const Mechanism& m, const Inertias& inertias, const Frames& frames) {
  MatX out = MatX::Zero(m.size(), m.size());
  for (std::size_t k = 0; k < m.bodies.size(); ++k) {
    const NodeBody& b = m.bodies[k];
    const Pose& T = frames.at(b.node);
    const Mat3 I = T.R * inertias[k] * T.R.transpose();
    const auto& path = m.path[at(b.node)];
    std::vector<Vec6> columns(path.size()), weighted(path.size());
    for (std::size_t i = 0; i < path.size(); ++i) {
      columns[i] = column(m, frames, path[i], T * b.com);
      weighted[i] << b.mass * columns[i].head<3>(), I * columns[i].tail<3>();
    }
    for (std::size_t i = 0; i < path.size(); ++i)
      for (std::size_t j = 0; j < path.size(); ++j) out(path[i], path[j]) += columns[i].dot(weighted[j]);
  }
  return out;
}

void drive_dynamics(const Mechanism& m, const Inertias& inertias, const VecX& x, const Frames& frames,
                    const LoopRates& loops, const Motion& motion, const DynamicsInput& in, DynamicsResult& out) {
  const Mat3& R = frames.at(m.tip).R;
  Mat6X J = motion.J;
  mask(m, R, J);
  Orthogonal solver;
  solver.compute(J, rank_threshold);

  // Rates of the drives from the tip's twist, then of everything.
  Vec6 v = in.twist;
  mask(m, R, v);
  if (in.rate.size() > 0) {
    out.rate = in.rate;
  } else {
    solver.solve(v, out.rate);
    out.rate = motion.sharing * out.rate;
  }
  out.misfit = v.norm() > 0 ? (J * out.rate - v).norm() / v.norm() : 0;
  const VecX rate = motion.rates * out.rate;

  // Accelerations with the drives' own left out, closed again by the passive coordinates.
  const VecX still = VecX::Zero(m.size());
  MatX follow = MatX::Zero(m.size(), 1);
  std::vector<Movement> moved = move(m, frames, rate, still);
  if (m.closures() > 0) loops.solve(m, -loop_accelerations(m, moved), follow);
  moved = move(m, frames, rate, follow.col(0));
  Vec6 a;
  a << in.twist_rate.head<3>() - moved[at(m.tip)].a, in.twist_rate.tail<3>() - moved[at(m.tip)].b;
  mask(m, R, a);
  VecX drives_follow(out.rate.size());
  for (std::size_t d = 0; d < m.drives.size(); ++d)
    drives_follow[static_cast<Index>(d)] = follow(m.drives[d].coordinate, 0);
  VecX own;  // acceleration of the drives beyond what closes the loops
  if (in.rate.size() > 0) {
    own = in.acceleration - drives_follow;
  } else {
    solver.solve(a, own);
    own = motion.sharing * own;
  }
  out.acceleration = drives_follow + own;
  Vec6 wanted = in.twist_rate;
  mask(m, R, wanted);
  const double size = wanted.norm() + v.squaredNorm() / m.length;
  if (size > 0) out.misfit = std::max(out.misfit, (J * own - a).norm() / size);
  moved = move(m, frames, rate, follow.col(0) + motion.rates * own);

  VecX force = VecX::Zero(m.size());
  out.kinetic = 0;
  out.potential = add_springs(m, frames, x, force);
  for (std::size_t k = 0; k < m.bodies.size(); ++k) {
    const NodeBody& b = m.bodies[k];
    const Pose& T = frames.at(b.node);
    const Movement& now = moved[at(b.node)];
    const Vec3 arm = T.R * b.com, p = T.p + arm, speed = now.v + now.w.cross(arm);
    const Mat3 I = T.R * inertias[k] * T.R.transpose();
    Vec6 w;
    w << b.mass * (now.acceleration_at(arm) - in.gravity), I * now.b + now.w.cross(I * now.w);
    add_force(m, frames, b.node, p, w, force);
    out.kinetic += 0.5 * (b.mass * speed.squaredNorm() + now.w.dot(I * now.w));
    out.potential -= b.mass * in.gravity.dot(p);
  }
  add_force(m, frames, m.tip, frames.at(m.tip).p, -in.wrench, force);
  out.effort = motion.rates.transpose() * force;
  out.mass = congruent(coordinate_mass(m, inertias, frames), motion.rates);
}

}  // namespace stiffmap
