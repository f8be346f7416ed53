// SPDX-License-Identifier: MIT
#include "stiffmap/kinematics/charts.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace stiffmap {
namespace {

const Vec3& axis_of(const Mechanism& m, Index j) { return m.nodes[at(m.coordinates[at(j)].node)].axis; }

Mat3 rotation(const Mechanism& m, const Ball& b, const Vec3& q) {
  Mat3 out = rotation_about(axis_of(m, b.first), q[0]);
  for (Index k = 1; k < 3; ++k) out = (out * rotation_about(axis_of(m, b.first + k), q[k])).eval();
  return out;
}

/// Angle about the unit vector `axis` that turns `from` to `to`, both at the same angle to it; nearest to `near`.
double angle(const Vec3& axis, const Vec3& from, const Vec3& to, double near) {
  const double out = std::atan2(axis.dot(from.cross(to)), from.dot(to) - axis.dot(from) * axis.dot(to));
  return near + std::remainder(out - near, 2 * std::numbers::pi);
}

/// The two triples of angles about a ball's own axes that make the rotation R: the nearer to `near`.
Vec3 angles(const Mechanism& m, const Ball& b, const Mat3& R, const Vec3& near) {
  const Vec3 &a = axis_of(m, b.first), &middle = axis_of(m, b.first + 1), &c = axis_of(m, b.first + 2);
  const Vec3 last = R * c;
  // The angle between first and last axis is that of q2 from the lock, to either side.
  const double lock = b.middle - std::numbers::pi / 2, open = std::atan2(a.cross(last).norm(), a.dot(last));
  Vec3 best = near;
  double least = std::numeric_limits<double>::infinity();
  for (const double side : {-1.0, 1.0}) {
    Vec3 q;
    q[1] = near[1] + std::remainder(lock + side * open - near[1], 2 * std::numbers::pi);
    const Vec3 from = rotation_about(middle, q[1]) * c;
    // At the lock the first angle is open.
    q[0] = b.spread(q[1]) < locked ? near[0] : angle(a, from, last, near[0]);
    const Vec3 perpendicular =
        std::abs(c.x()) < 0.8 ? c.cross(Vec3::UnitX()).normalized() : c.cross(Vec3::UnitY()).normalized();
    const Mat3 AB = rotation_about(a, q[0]) * rotation_about(middle, q[1]);
    q[2] = angle(c, perpendicular, AB.transpose() * (R * perpendicular), near[2]);
    const double off = (q - near).cwiseAbs().maxCoeff();
    if (off < least) {
      least = off;
      best = q;
    }
  }
  return best;
}

}  // namespace

bool keep_off_locks(const Mechanism& m, VecX& x, Charts& charts) {
  bool changed = false;
  for (std::size_t i = 0; i < m.balls.size(); ++i) {
    const Ball& b = m.balls[i];
    const auto held = [&](Index k) { return m.coordinates[at(b.first + k)].locked; };
    if (!b.free || held(1) || b.spread(x[b.first + 1]) >= narrow) continue;
    if (charts.plain()) charts.turns.resize(m.balls.size());
    Vec3 q = x.segment<3>(b.first);
    const Mat3 was = rotation(m, b, q);
    q[1] = x[b.first + 1] = b.middle;
    const Mat3 is = rotation(m, b, q);
    // The line of a spin that is held stays where it is: the first axis in the body before the joint, the last in the
    // one behind.
    Charts::Turn& turn = charts.turns[i];
    if (held(0)) turn.after = (is.transpose() * was * turn.after).eval();
    else turn.before = (turn.before * was * is.transpose()).eval();
    turn.used = changed = true;
  }
  return changed;
}

VecX by_own_axes(const Mechanism& m, const Charts& charts, const VecX& x, const VecX& near) {
  VecX out = x;
  for (std::size_t i = 0; i < charts.turns.size(); ++i) {
    const Ball& b = m.balls[i];
    const Charts::Turn& turn = charts.turns[i];
    const Mat3 R = turn.before * rotation(m, b, x.segment<3>(b.first)) * turn.after;
    if (turn.used) out.segment<3>(b.first) = angles(m, b, R, near.segment<3>(b.first));
  }
  return out;
}

}  // namespace stiffmap
