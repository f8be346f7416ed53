// SPDX-License-Identifier: MIT
// Newton's step of a serial arm in its joints alone: as many equations as joints, no wrench or tangent of the platform
// (docs/fast_path.md F14). Only the linearisation at the answer needs those.
#pragma once

#include "elimination.hpp"

namespace stiffmap::kernel {

inline constexpr int most_serial_joints = 12;

/// Steps of all joints under `load` at `point`, of which the tangent knows, and `pending`, of which it does not (F11).
[[gnu::noinline]] inline void serial_step(Elimination& el, V3 point, const V6& load, const V6& pending) {
  const Program& P = el.P;
  const int n = P.serial_joints;
  const Op* joint[most_serial_joints];
  V B[most_serial_joints][most_serial_joints], g[most_serial_joints];
  for (int i = 0, k = 0; i < P.serial_count; ++i)
    if (P.ops[P.serial[i]].kind != OpKind::load) joint[k++] = P.ops + P.serial[i];
  // Of all that acts behind the joint: force, and the sum of its lever arms times forces; with what is pending, force
  // and moment about the joint.
  V3 force = load.a, all = load.a + pending.a, moment = load.b + pending.b;
  M3 arms{};
  const auto lever = [&](const V3& r, const V3& f) {
    for (int k = 0; k < 3; ++k) arms.c[k] = arms.c[k] + (k == 0 ? f.x : k == 1 ? f.y : f.z) * r;
  };
  int b = n - 1;
  for (int i = P.serial_count - 1; i >= 0; --i) {
    const Op& op = P.ops[P.serial[i]];
    const JointSlot& j = el.s.joints[op.slot];
    const V3 r = point - j.o;
    lever(r, force);
    moment = moment + cross(r, all);
    point = j.o;
    if (op.kind == OpKind::load) {
      if (!el.heavy) continue;
      const V3 weight = splat(op.mass) * el.gravity, whole = weight + splat(op.mass) * el.pending;
      lever(j.w, weight);
      force = force + weight;
      moment = moment + cross(j.w, whole);
      all = all + whole;
      continue;
    }
    const bool turns = op.kind == OpKind::revolute;
    const V3 below = turns ? arms * j.w - (arms.c[0].x + arms.c[1].y + arms.c[2].z) * j.w : cross(j.w, force);
    const V3 above = turns ? below + cross(j.w, load.b) : below;  // a dead moment: theory E4
    for (int a = 0; a <= b; ++a) {
      const bool both = joint[a]->kind == OpKind::revolute;
      const V3& w = el.s.joints[joint[a]->slot].w;
      B[a][b] = both ? -dot(w, below) : splat(0);
      B[b][a] = both ? -dot(w, above) : splat(0);
    }
    g[b] = dot(j.w, turns ? moment : all) - el.s.tau[op.coordinate];
    --b;
  }
  for (int k = 0; k < n; ++k) {
    const int q = joint[k]->coordinate;
    for (int i = 0; i < n; ++i) B[i][k] *= el.s.da[q];
    B[k][k] += el.s.dtau[q];
  }
  for (int k = 0; k < n; ++k) {
    el.guard(B[k][k], P.coordinates[joint[k]->coordinate].unit);
    const V inverse = 1.0 / B[k][k];
    for (int i = k + 1; i < n; ++i) {
      const V f = B[i][k] * inverse;
      for (int c = k + 1; c < n; ++c) B[i][c] -= f * B[k][c];
      g[i] -= f * g[k];
    }
    B[k][k] = inverse;
  }
  for (int k = n - 1; k >= 0; --k) {
    for (int c = k + 1; c < n; ++c) g[k] -= B[k][c] * g[c];
    g[k] *= B[k][k];
    el.s.dz[joint[k]->coordinate] = g[k];
  }
}

}  // namespace stiffmap::kernel
