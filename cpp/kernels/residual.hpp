// SPDX-License-Identifier: MIT
// Residual of a perturbed program, or a little further, with the factors of the last tangent (docs/fast_path.md F10).
#pragma once

#include "angles.hpp"
#include "groups.hpp"
#include "springs.hpp"

namespace stiffmap::kernel {

inline void joint_residual(Elimination& el, const Op& op, V6& c) {
  JointSlot& j = el.s.joints[op.slot];
  const int q = op.coordinate;
  const V rho = el.s.tau[q] - dot(j.w, op.kind == OpKind::prismatic ? j.F.a : j.F.b);
  j.y = (dot(j.J, c) - rho) * j.inverse;
  c = c - (el.s.da[q] * j.y) * j.u;
}

inline V6 residual(Elimination& el, const ChainProgram& chain, const V3& end);

inline V6 stiff_residual(Elimination& el, const Op& op) {
  const StiffSlot& k = el.s.stiff[op.slot];
  if (op.kind == OpKind::spring) return spring_wrench(el, op, k) - k.F;
  V6 sum{};
  for (int b = 0; b < op.count; ++b) {
    BranchSlot& branch = el.s.branches[op.first + b];
    V6 c = branch.rest;
    if (!el.skips(op, b)) c = residual(el, el.P.chains[op.first + b], branch.end.p);
    if (el.only == Elimination::all) branch.rest = branch.c = c;
    if (b > 0) {
      branch.error = frame_error(branch.end, el.s.branches[op.first].end);
      c = c + dead(branch.K, branch.F.b, branch.error);
    }
    sum = sum + c;
  }
  return sum;
}

inline void series_residual(StiffSlot& k, const V6& inner, V6& c) {
  V(&y)[6] = k.y;
  put(c - inner, y);
  for (int i = 1; i < 6; ++i)
    for (int q = 0; q < i; ++q) y[i] -= k.L[i][q] * y[q];
  V sum[6];
  for (int col = 0; col < 6; ++col) sum[col] = splat(0);
  for (int i = 0; i < 6; ++i) {
    const V d = k.inverse[i] * y[i];
    for (int col = 0; col < 6; ++col) sum[col] += k.X[i][col] * d;
  }
  c = c - get(sum);
}

/// Out-of-balance wrench at the end of a chain, at the frames and wrenches of the last passes; what a step needs of it
/// stays in the slots.
inline V6 residual(Elimination& el, const ChainProgram& chain, const V3& end) {
  V6 c{};
  V3 p{};
  const auto move_to = [&](const V3& to) {
    c.b = c.b - cross(to - p, c.a);
    p = to;
  };
  if (chain.group >= 0) {
    c = group_residual(el, chain, {});
    p = el.s.joints[el.P.ops[chain.first_stiff].slot].o;
  }
  for (int i = chain.group >= 0 ? chain.first_stiff + 1 : chain.first_stiff; i < chain.first + chain.count; ++i) {
    const Op& op = el.P.ops[i];
    if (op.kind == OpKind::load || (op.kind <= OpKind::prismatic && !op.eliminated)) continue;
    if (op.kind <= OpKind::prismatic) {
      move_to(el.s.joints[op.slot].o);
      joint_residual(el, op, c);
    } else if (i > chain.first_stiff) {
      StiffSlot& k = el.s.stiff[op.slot];
      move_to(k.p);
      series_residual(k, stiff_residual(el, op), c);
    } else {
      c = stiff_residual(el, op);
      p = el.s.stiff[op.slot].p;
      for (int q = i - 1; q >= chain.first; --q)
        if (el.P.ops[q].kind <= OpKind::prismatic && el.P.ops[q].eliminated) joint_residual(el, el.P.ops[q], c);
    }
  }
  move_to(end);
  return c;
}

}  // namespace stiffmap::kernel
