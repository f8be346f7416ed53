// SPDX-License-Identifier: MIT
#include "stiffmap/linearization.hpp"

namespace stiffmap {
namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

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

void add_loads(const Mechanism& m, const Problem& p, Linearization& out) {
  for (std::size_t i = 0; i < p.load_points.size(); ++i) {
    const LoadPoint& at_point = p.load_points[i];
    const Pose& T = out.frames.at(at_point.node);
    PointWrench w{at_point.node, T * at_point.offset, p.factor * p.wrenches[i].head<3>(),
                  p.factor * p.wrenches[i].tail<3>()};
    if (at_point.type == LoadType::follower) {
      w.f = T.R * w.f;
      w.m = T.R * w.m;
      w.turn_force = w.turn_moment = 1;
    } else if (at_point.type == LoadType::semitangential) {
      w.turn_moment = 0.5;
    }
    if (w.f.isZero(0) && w.m.isZero(0)) continue;
    add_wrench(m, w, out);
  }
  if (!p.gravity.isZero(0))
    for (const NodeBody& b : m.bodies)
      add_wrench(m, {b.node, out.frames.point(b.node, b.com), p.factor * b.mass * p.gravity, Vec3::Zero()}, out);
}

void add_external_spring(const Mechanism& m, const NodeSpring& s, Linearization& out) {
  const Vec3 p = out.frames.point(s.node, s.offset), d = p - s.anchor;
  const double length = d.norm();
  if (length < 1e-12 || (s.tension_only && length <= s.length)) return;
  const Vec3 u = d / length;
  const double force = s.stiffness * (length - s.length);
  add_wrench(m, {s.node, p, -force * u, Vec3::Zero()}, out);
  const Mat3 k = s.stiffness * u * u.transpose() + force / length * (Mat3::Identity() - u * u.transpose());
  const auto& path = m.path[at(s.node)];
  for (Index i : path)
    for (Index j : path)
      out.K(i, j) += column(m, out.frames, i, p).head<3>().dot(k * column(m, out.frames, j, p).head<3>());
}

/// The two ends of a loop carry opposite wrenches; inside, half of the moment follows the frames,
/// which makes the tangent symmetric and changes only the meaning of the multiplier (theory E5).
void add_loops(const Mechanism& m, const State& state, Linearization& out) {
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    const Loop& loop = m.loops[i];
    const Index row = 6 * static_cast<Index>(i);
    const Pose &a = out.frames.at(loop.primary), &b = out.frames.at(loop.end);
    out.e.segment<6>(row) = frame_error(a, b);
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
      out.tau[j] = q.tau;
      out.da[j] = q.da;
      out.dtau[j] = q.dtau;
      out.kind[at(j)] = q.da == 0 ? Kind::fixed : q.dtau == 0 ? Kind::free : Kind::elastic;
    }
    out.x[j] = p.base[j] + a;
  }
}

void add_springs(const Mechanism& m, Linearization& out) {
  for (const SpringGroup& g : m.groups) {
    const Vec6 d = out.x.segment<6>(g.first) - g.rest;
    const Mat6& V = g.matrix.basis;
    const Mat6 K = g.matrix.rotated ? Mat6(V * g.matrix.stiffness * V.transpose()) : g.matrix.stiffness;
    out.tau.segment<6>(g.first) += K * d;
    out.K.block<6, 6>(g.first, g.first) += K;
    for (int i = 0; i < 6; ++i) {
      const bool law = m.coordinates[at(g.first + i)].law >= 0;
      if (g.matrix.rigid[i] && !g.matrix.rotated) out.kind[at(g.first + i)] = Kind::fixed;
      else if (!law && K(i, i) > 0) out.kind[at(g.first + i)] = Kind::elastic;
    }
  }
}

}  // namespace

bool Problem::has_dead_moment() const {
  for (std::size_t i = 0; i < load_points.size(); ++i) {
    if (load_points[i].type == LoadType::follower && !wrenches[i].isZero(0)) return true;
    if (load_points[i].type == LoadType::dead && !wrenches[i].tail<3>().isZero(0)) return true;
  }
  return false;
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
  forward(m, Geometry::actual, out.x, out.frames);
  out.K.setZero();
  out.H.setZero();
  out.J.setZero();
  out.r.setZero();
  add_springs(m, out);
  add_loads(m, problem, out);
  for (const NodeSpring& s : m.external_springs) add_external_spring(m, s, out);
  add_loops(m, state, out);
  out.r += out.tau;
}

}  // namespace stiffmap
