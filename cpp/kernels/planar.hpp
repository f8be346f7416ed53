// SPDX-License-Identifier: MIT
// Closed form of a leg with three parallel revolutes and a slide along them (docs/fast_path.md, Closure).
#pragma once

#include "angles.hpp"
#include "slots.hpp"

namespace stiffmap::kernel {

inline V3 constant(const double (&a)[3]) { return {splat(a[0]), splat(a[1]), splat(a[2])}; }

/// Joint coordinates where the leg's end is `end`, on the branch of home; returns the lanes in reach
/// and not next to the stretched or folded leg, and adds those that are certainly out of reach to `never`.
inline M close_planar(const PlanarLeg& leg, const Frame& end, V* x, M& never) {
  const V3 u = constant(leg.u), v = constant(leg.v);
  const V3 third = end.p + end.R * constant(leg.third);
  const V3 arm = third - constant(leg.first), heading = end.R * constant(leg.heading);
  const V dx = dot(u, arm), dy = dot(v, arm);
  const V cosine = (dx * dx + dy * dy - leg.sum) * leg.inverse;
  const V square = 1.0 - cosine * cosine;
  const M reached = square > 1e-5;
  never |= square < -1e-6;
  const V sine = leg.branch * root(select(reached, square, splat(1)));
  const V gx = leg.a[0] + cosine * leg.b[0] - sine * leg.b[1], gy = leg.a[1] + cosine * leg.b[1] + sine * leg.b[0];
  const V first = arc_tangent(dy, dx) - arc_tangent(gy, gx);
  const V second = arc_tangent(sine, cosine) - leg.bend;
  const V whole = arc_tangent(dot(v, heading), dot(u, heading));
  const V motion[4] = {first, second, whole - first - second, dot(constant(leg.w), third) - leg.height};
  for (int k = 0; k < 4; ++k) x[leg.coordinate[k]] = leg.home[k] + leg.sense[k] * motion[k];
  return reached;
}

}  // namespace stiffmap::kernel
