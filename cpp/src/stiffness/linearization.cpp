// SPDX-License-Identifier: MIT
#include "stiffmap/stiffness/linearization.hpp"

#include "stiffmap/kinematics/pull.hpp"

namespace stiffmap {
namespace {

/// Force, moment and the rule by which they follow the body's rotation.
struct PointWrench {
  Index node;
  Vec3 p, f, m;
  double turn_force = 0, turn_moment = 0;  ///< 0 dead, 1 follower, 1/2 semitangential
};

/// Adds J^T F to -r and its derivative to H, theory (E4): with a nearer the base than b,
/// H_ba = w_a·[(1 - s) v_b x f + (1 - t) w_b x m], H_ab = w_a·[v_b x f + t w_b x m] + s v_a·(w_b x f),
/// where force and moment follow the body's rotation by the shares s and t.
void add_wrench(const Mechanism& mech, const PointWrench& w, Linearization& out) {
  const auto& path = mech.path[at(w.node)];
  const double s = w.turn_force, t = w.turn_moment;
  for (std::size_t ib = 0; ib < path.size(); ++ib) {
    const Index b = path[ib];
    const Vec6 c = column(mech, out.frames, b, w.p);
    out.r[b] -= c.head<3>().dot(w.f) + c.tail<3>().dot(w.m);
    const Vec3 vf = c.head<3>().cross(w.f), wm = c.tail<3>().cross(w.m);
    const Vec3 below = (1 - s) * vf + (1 - t) * wm, above = vf + t * wm;
    for (std::size_t ia = 0; ia < ib; ++ia) {
      const Index a = path[ia];
      if (mech.coordinates[at(a)].type == JointType::revolute) {
        out.H(b, a) += out.frames.axis.col(a).dot(below);
        out.H(a, b) += out.frames.axis.col(a).dot(above);
      }
      if (s != 0) out.H(a, b) += s * column(mech, out.frames, a, w.p).head<3>().dot(c.tail<3>().cross(w.f));
    }
    out.H(b, b) += (1 - s) * c.tail<3>().dot(vf);
  }
}

/// Adds to H what a moment does that changes by D w when its body turns by w.
void add_turning_moment(const Mechanism& m, Index node, const Mat3& D, Linearization& out) {
  const auto revolute = [&](Index j) { return m.coordinates[at(j)].type == JointType::revolute; };
  for (Index b : m.path[at(node)])
    for (Index a : m.path[at(node)])
      if (revolute(a) && revolute(b)) out.H(b, a) += out.frames.axis.col(b).dot(D * out.frames.axis.col(a));
}

/// Derivative of a semitangential moment m with respect to the rotation of its body: theory (E6).
Mat3 semitangential_derivative(const Vec3& m, const Mat3& R) {
  const Vec3 trace(R(1, 2) - R(2, 1), R(2, 0) - R(0, 2), R(0, 1) - R(1, 0));  // d tr(R) = trace . w
  return 0.5 * (m * trace.transpose() - R.transpose() * skew(m));
}

void add_loads(const Mechanism& m, const Problem& p, Linearization& out) {
  for (std::size_t i = 0; i < p.load_points.size(); ++i) {
    if (p.wrenches[i].isZero(0)) continue;
    const LoadPoint& load = p.load_points[i];
    const Pose& T = out.frames.at(load.node);
    const Vec6 now = p.factor * p.wrench_at(i, T.R);
    const double follows = load.type == LoadType::follower ? 1 : 0;
    add_wrench(m, {load.node, T * load.offset, now.head<3>(), now.tail<3>(), follows, follows}, out);
    if (load.type == LoadType::semitangential)
      add_turning_moment(m, load.node, semitangential_derivative(p.factor * p.wrenches[i].tail<3>(), p.turn(i, T.R)),
                         out);
  }
  if (!p.gravity.isZero(0))
    for (const NodeBody& b : m.bodies)
      add_wrench(m, {b.node, out.frames.point(b.node, b.com), p.factor * b.mass * p.gravity, Vec3::Zero()}, out);
}

/// Theory (B4): its stiffness along the line, and what the force does that turns with it. `linear`: also if slack.
void add_external_spring(const Mechanism& m, const NodeSpring& s, bool linear, Linearization& out) {
  const Vec3 p = pulled_point(s, out.frames);
  const CableLine line = line_of(s, p);
  const Pull pull = pull_of(s, line.length, free_length(s, out.x), linear && s.winch);
  if (pull.stiffness == 0 || line.along.isZero(0)) return;
  if (s.winch) out.r[s.coordinate] -= pull.force;  // what the winch has to hold
  add_wrench(m, {s.node, p, -pull.force * line.along, Vec3::Zero()}, out);
  const Mat3 k = pull.stiffness * line.along * line.along.transpose() + pull.force * line.bend;
  const auto& path = m.path[at(s.node)];
  for (Index i : path)
    for (Index j : path)
      out.K(i, j) += column(m, out.frames, i, p).head<3>().dot(k * column(m, out.frames, j, p).head<3>());
}

/// The two ends of a loop carry opposite wrenches; inside, half of the moment follows the frames,
/// which makes the tangent symmetric and changes only the meaning of the multiplier (theory E5).
void add_loops(const Mechanism& m, const Problem& p, const State& state, Linearization& out) {
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    const Loop& loop = m.loops[i];
    const Index row = 6 * static_cast<Index>(i);
    const Pose &a = out.frames.at(loop.primary), &b = out.frames.at(loop.end);
    out.e.segment<6>(row) = frame_error(a, b) - p.misfit.segment<6>(row);
    add_jacobian(m, out.frames, loop.end, b.p, 1.0, out.J.middleRows<6>(row));
    add_jacobian(m, out.frames, loop.primary, a.p, -1.0, out.J.middleRows<6>(row));
    const Vec6 w = state.lambda.segment<6>(row);
    add_wrench(m, {loop.end, b.p, w.head<3>(), w.tail<3>(), 0, 0.5}, out);
    add_wrench(m, {loop.primary, a.p, -w.head<3>(), -w.tail<3>(), 0, 0.5}, out);
  }
}

void evaluate_laws(const Mechanism& m, const Problem& p, const State& state, Linearization& out) {
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    out.da[j] = 1;
    out.dtau[j] = out.tau[j] = 0;
    double a = state.z[j];
    out.kind[at(j)] = Kind::free;
    if (c.locked) {
      a = 0;
      out.kind[at(j)] = Kind::fixed;
    } else if (c.law >= 0) {
      const Law& law = m.laws[at(c.law)];
      const double k = law.stiffness() / p.drive_scale[j];
      const LawPoint q = p.secant_laws ? LawPoint{0, 0, 1, k} : law.at(state.z[j], p.drive_scale[j]);
      a = q.a;
      out.tau[j] = q.tau + law.friction() * p.friction_sign[j];
      out.da[j] = q.da;
      out.dtau[j] = q.dtau;
      out.kind[at(j)] = q.da == 0 ? Kind::fixed : q.dtau == 0 ? Kind::free : Kind::elastic;
    } else if (c.friction != 0) {
      out.tau[j] = c.friction * p.friction_sign[j];
    }
    out.x[j] = p.base[j] + a;
  }
}

void add_springs(const Mechanism& m, const Problem& p, Linearization& out) {
  for (std::size_t i = 0; i < m.groups.size(); ++i) {
    const SpringGroup& g = m.groups[i];
    const Vec6 d = out.x.segment<6>(g.first) - g.rest;
    const Mat6& V = g.matrix.basis;
    const Mat6 K = g.matrix.rotated ? Mat6(V * p.springs[i] * V.transpose()) : p.springs[i];
    out.tau.segment<6>(g.first) += K * d;
    out.K.block<6, 6>(g.first, g.first) += K;
    for (int k = 0; k < 6; ++k) {
      const bool law = m.coordinates[at(g.first + k)].law >= 0;
      if (g.matrix.rigid[k] && !g.matrix.rotated) out.kind[at(g.first + k)] = Kind::fixed;
      else if (!law && K(k, k) > 0) out.kind[at(g.first + k)] = Kind::elastic;
    }
  }
}

}  // namespace

bool Problem::is_nonconservative() const {
  for (std::size_t i = 0; i < load_points.size(); ++i)
    if (nonconservative(load_points[i].type, wrenches[i])) return true;
  return false;
}

Mat3 Problem::turn(std::size_t i, const Mat3& R) const {
  return i < load_frames.size() ? Mat3(R * load_frames[i].transpose()) : R;
}

Vec6 Problem::wrench_at(std::size_t i, const Mat3& R) const {
  const LoadType type = load_points[i].type;
  Vec6 w = wrenches[i];
  if (type == LoadType::dead) return w;
  const Mat3 by = turn(i, R);
  if (type == LoadType::follower) w << by * w.head<3>(), by * w.tail<3>();
  else w.tail<3>() = 0.5 * (by.trace() * w.tail<3>() - by.transpose() * w.tail<3>());
  return w;
}

Linearization::Linearization(const Mechanism& m)
    : frames(m),
      x(VecX::Zero(m.size())),
      tau(VecX::Zero(m.size())),
      da(VecX::Ones(m.size())),
      dtau(VecX::Zero(m.size())),
      r(VecX::Zero(m.size())),
      e(VecX::Zero(m.closures())),
      K(MatX::Zero(m.size(), m.size())),
      H(MatX::Zero(m.size(), m.size())),
      J(MatX::Zero(m.closures(), m.size())),
      kind(static_cast<std::size_t>(m.size())) {}

void Linearization::point_jacobian(const Mechanism& m, Index node, const Vec3& offset, Eigen::Ref<MatX> out) const {
  out.setZero();
  add_jacobian(m, frames, node, frames.point(node, offset), 1.0, out);
}

void linearize(const Mechanism& m, const Problem& problem, const State& state, Linearization& out) {
  evaluate_laws(m, problem, state, out);
  forward(m, Geometry::actual, out.x, out.frames, &state.charts);
  out.K.setZero();
  out.H.setZero();
  out.J.setZero();
  out.r.setZero();
  add_springs(m, problem, out);
  add_loads(m, problem, out);
  if (problem.first_order) out.H.setZero();
  for (const NodeSpring& s : m.external_springs)
    if (!problem.unpulled || s.node != m.tip) add_external_spring(m, s, problem.secant_laws, out);
  add_loops(m, problem, state, out);
  out.r += out.tau;
}

}  // namespace stiffmap
