// SPDX-License-Identifier: MIT
// How far a block of poses is from equilibrium: the reference's merit (SaddleSystem::merit), squared, from frames and
// wrenches of the last passes.
#pragma once

#include "angles.hpp"
#include "springs.hpp"

namespace stiffmap::kernel {

/// Out-of-balance force of a joint, squared, over its stiffness; of a free one over that of the machine.
inline V joint_merit(const Elimination& el, const Op& op) {
  const JointSlot& j = el.s.joints[op.slot];
  const int q = op.coordinate;
  const double unit = el.P.coordinates[q].unit;
  const V own = el.s.da[q] * el.s.dtau[q];
  const V scale = select(own > 0.0, own, splat(el.P.stiffness * unit * unit));
  const V r = el.s.da[q] * (el.s.tau[q] - dot(j.w, op.kind == OpKind::prismatic ? j.F.a : j.F.b));
  return r * r / scale;
}

/// The same for the six coordinates of a spring.
inline V spring_merit(Elimination& el, const Op& op) {
  const StiffSlot& k = el.s.stiff[op.slot];
  const V6 c = spring_wrench(el, op, k) - k.F;
  const V3 n = cross(k.Z.c[0], k.Z.c[1]);
  const V3 axis[6] = {k.start.R.c[0], k.start.R.c[1], k.start.R.c[2],
                      k.start.R.c[0], k.Z.c[1],       (1.0 / dot(n, k.Z.c[2])) * n};
  V sum = splat(0);
  for (int i = 0; i < 6; ++i) {
    const V r = dot(axis[i], i < 3 ? c.a : c.b);
    sum += r * r / (op.stroke < 0 ? splat(op.K[7 * i]) : el.s.strokes[op.stroke].K[7 * i]);
  }
  return sum;
}

[[gnu::noinline]] inline V merit(Elimination& el) {
  V sum = splat(0);
  for (int i = 0; i < el.P.op_count; ++i) {
    const Op& op = el.P.ops[i];
    if (op.kind == OpKind::spring) sum += spring_merit(el, op);
    else if (op.kind <= OpKind::prismatic && op.eliminated) sum += joint_merit(el, op);
    for (int b = 1; op.kind == OpKind::block && b < op.count; ++b) {
      const V6 e = frame_error(el.s.branches[op.first + b].end, el.s.branches[op.first].end);
      sum += el.P.stiffness * (dot(e.a, e.a) + el.P.length * el.P.length * dot(e.b, e.b));
    }
  }
  return sum;
}

}  // namespace stiffmap::kernel
