// SPDX-License-Identifier: MIT
// Closed form of an arm of six revolutes whose second to fourth axes are parallel and whose last two meet
// (Hawkins, Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms, 2013; here for axes in any
// direction).
#pragma once

#include "planar.hpp"

namespace stiffmap::kernel {

/// A turn about a unit axis through the origin.
struct AxisTurn {
  V3 w;
  V c, s;
  [[gnu::always_inline]] V3 operator*(const V3& x) const {
    return c * x + s * cross(w, x) + ((1.0 - c) * dot(w, x)) * w;
  }
  AxisTurn back() const { return {w, c, -s}; }
};

/// The turn t about w with A cos t + B sin t = C, on the branch of `sign`; adds to `ok` where it is not next to the
/// end of the branch, with the sine of the angle to there above 0.01.
inline AxisTurn turn_to(const V3& w, V A, V B, V C, double sign, M& ok) {
  const V size = A * A + B * B, square = size - C * C;
  ok &= square > 1e-4 * size;
  const V q = sign * root(select(square > 0.0, square, splat(0))), inverse = 1.0 / size;
  return {w, (A * C - B * q) * inverse, (B * C + A * q) * inverse};
}

/// Angle in -pi .. pi.
inline V wrapped(V angle) {
  constexpr double whole = 6.28318530717958647693, shift = 6755399441055744.0;
  return angle - whole * ((angle * (1 / whole) + shift) - shift);
}

/// Joint coordinates where the arm's end is `end`, on the branch of home; returns the lanes that are far from the ends
/// of that branch and not more than `most` from home: further away a continuation may have gone the other way round.
[[gnu::noinline]] inline M close_arm(const FirstTurn& base, const ArmLeg& arm, const Frame& end, V* x) {
  constexpr double most = 2.0;
  const V3 u = constant(arm.u), w1 = constant(base.axis), w5 = constant(arm.w5), w6 = constant(arm.w6);
  const V3 along = constant(arm.along), across = constant(arm.across), first = constant(base.point);
  M3 turn;  // of the end since home
  for (int k = 0; k < 3; ++k)
    turn.c[k] = end.R * V3{splat(arm.end_R[k]), splat(arm.end_R[3 + k]), splat(arm.end_R[6 + k])};
  M ok = ~M{};
  const V3 wrist = end.p + turn * constant(arm.wrist) - first;
  const V height = arm.lean1 * dot(w1, wrist);
  const AxisTurn t1 =
      turn_to(w1, dot(u, wrist) - height, -dot(u, cross(w1, wrist)), arm.height1 - height, arm.side, ok);
  const AxisTurn undo1 = t1.back();
  const AxisTurn t5 = turn_to(w5, splat(arm.A5), splat(arm.B5), dot(u, undo1 * (turn * w6)) - arm.lean5, arm.flip, ok);
  const AxisTurn undo5 = t5.back();
  // The last joint turns what the fifth leaves of u to where the end has it.
  const V3 had = undo5 * u, has = turn % (t1 * u);
  const V y = dot(w6, cross(had, has)), z = dot(had, has) - dot(w6, had) * dot(w6, has);
  const V inverse = 1.0 / root(y * y + z * z);
  const AxisTurn undo6{w6, z * inverse, y * inverse};
  // What is left is a turn in the plane, of the fourth axis' point and in all.
  const V3 fourth = undo1 * (turn * (constant(arm.wrist) + undo6 * (undo5 * constant(arm.fourth))) + end.p - first);
  const V3 arrow = undo1 * (turn * (undo6 * (undo5 * along))), way = fourth + first - constant(arm.second);
  const V dx = dot(along, way), dy = dot(across, way);
  const V cosine = (dx * dx + dy * dy - arm.sum) * arm.inverse, square = 1.0 - cosine * cosine;
  ok &= square > 1e-4;
  const V sine = arm.branch * root(select(square > 0.0, square, splat(0)));
  const V gx = arm.a[0] + cosine * arm.b[0] - sine * arm.b[1], gy = arm.a[1] + cosine * arm.b[1] + sine * arm.b[0];
  const V second = wrapped(arc_tangent(dy, dx) - arc_tangent(gy, gx));
  const V third = wrapped(arc_tangent(sine, cosine) - arm.bend);
  const V whole = arc_tangent(dot(across, arrow), dot(along, arrow));
  const V motion[6] = {arc_tangent(t1.s, t1.c), second, third, wrapped(whole - second - third), arc_tangent(t5.s, t5.c),
                       arc_tangent(-y, z)};
  for (int k = 0; k < 6; ++k) {
    ok &= absolute(motion[k]) < most;
    x[arm.coordinate[k]] = select(ok, arm.home[k] + arm.sense[k] * motion[k], x[arm.coordinate[k]]);
  }
  return ok;
}

/// Home turned about the first axis to where `tip` is about it, in some lanes: all that follows it turns with it, on
/// the branch of home.
inline void turn_home(const FirstTurn& joint, const V3& tip, M lanes, Frame& home, V* x) {
  const V3 w = constant(joint.axis), first = constant(joint.point), lever = home.p - first;
  const V3 from = cross(w, lever), to = cross(w, tip - first);
  const V s = dot(w, cross(from, to)), c = dot(from, to), square = s * s + c * c;
  lanes &= square > 1e-20;
  const V inverse = 1.0 / root(select(lanes, square, splat(1)));
  const AxisTurn turn{w, c * inverse, s * inverse};
  home.p = select(lanes, first + turn * lever, home.p);
  for (V3& axis : home.R.c) axis = select(lanes, turn * axis, axis);
  V& angle = x[joint.coordinate];
  angle = select(lanes, joint.home + arc_tangent(s, c), angle);
}

}  // namespace stiffmap::kernel
