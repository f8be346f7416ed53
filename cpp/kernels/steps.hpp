// SPDX-License-Identifier: MIT
// Back substitution: steps of all coordinates, from the tip to the base (docs/fast_path.md F4, F7, F8).
#pragma once

#include "groups.hpp"

namespace stiffmap::kernel {

/// Step of a joint from the twist behind it and the turn of the start; leaves the twist before it.
inline void joint_step(Elimination& el, const Op& op, V6& eta, const V3& turn) {
  const JointSlot& j = el.s.joints[op.slot];
  const int q = op.coordinate;
  V dz = dot(j.u, eta) * j.inverse + j.y;
  if (el.heavy) dz += dot(j.turn, turn) * j.inverse;
  el.s.dz[q] = dz;
  eta = eta - (el.s.da[q] * dz) * j.J;
}

inline void move_twist(V6& eta, const V3& from, const V3& to) { eta.a = eta.a + cross(eta.b, to - from); }

/// Relative twist of a spring or block from the twist behind it and the turn of the chain's start, where that `turns`.
inline V6 relative_twist(const StiffSlot& k, const V6& eta, const V3& turn, bool turns) {
  V e[6], z[6];
  put(eta, e);
  for (int i = 0; i < 6; ++i) {
    V sum = k.y[i];
    for (int col = 0; col < 6; ++col) sum += k.X[i][col] * e[col];
    if (turns) sum += k.turn[0][i] * turn.x + k.turn[1][i] * turn.y + k.turn[2][i] * turn.z;
    z[i] = k.inverse[i] * sum;
  }
  for (int i = 4; i >= 0; --i)
    for (int q = i + 1; q < 6; ++q) z[i] -= k.L[q][i] * z[q];
  return get(z);
}

inline void back(Elimination& el, const ChainProgram& chain, V6 eta, V3 p, const V3& turn, M active);

/// Steps inside a spring or block; `turn` is the rotation of its start frame.
inline void stiff_step(Elimination& el, const Op& op, const V6& zeta, const V3& turn, M active) {
  const StiffSlot& k = el.s.stiff[op.slot];
  if (op.kind == OpKind::spring) {
    V* dz = el.s.dz + op.coordinate;
    const V3 t = k.start.R % zeta.a, r = k.Z % zeta.b;
    dz[0] = t.x;
    dz[1] = t.y;
    dz[2] = t.z;
    dz[3] = r.x;
    dz[4] = r.y;
    dz[5] = r.z;
    for (int i = 0; i < 6 && el.P.starts_linear; ++i)
      if (el.P.coordinates[op.coordinate + i].law >= 0) dz[i] /= el.s.da[op.coordinate + i];
    return;
  }
  for (int b = 0; b < op.count; ++b) {
    BranchSlot& branch = el.s.branches[op.first + b];
    V6 own = zeta + branch.error;
    if (el.exact && b > 0) own.a = own.a + cross(turn, branch.error.a);
    if (b > 0) {
      V6 step = dead(branch.K, branch.F.b, own) + branch.c + V6{cross(turn, branch.F.a), cross(turn, branch.F.b)};
      if (el.heavy) step = step + turn.x * branch.turn[0] + turn.y * branch.turn[1] + turn.z * branch.turn[2];
      if (el.exact) step.b = step.b - splat(0.5) * cross(turn + own.b, branch.F.b);
      branch.before = branch.F;
      branch.F = {select(active, branch.F.a + step.a, branch.F.a), select(active, branch.F.b + step.b, branch.F.b)};
      const V force = larger(larger(absolute(step.a.x), absolute(step.a.y)), absolute(step.a.z));
      const V moment = larger(larger(absolute(step.b.x), absolute(step.b.y)), absolute(step.b.z));
      el.transferred =
          larger(el.transferred, larger(force * (1 / el.scale[0]), moment * (1 / el.scale[3])) * (1 / el.scale[3]));
    }
    back(el, el.P.chains[op.first + b], own, branch.end.p, turn, active);
  }
}

/// Steps of all coordinates of a chain from the twist of its end relative to its start.
inline void back(Elimination& el, const ChainProgram& chain, V6 eta, V3 p, const V3& turn, M active) {
  for (int i = chain.first + chain.count - 1; i > chain.first_stiff; --i) {
    const Op& op = el.P.ops[i];
    if (op.kind == OpKind::load || (op.kind <= OpKind::prismatic && !op.eliminated)) continue;
    if (op.kind <= OpKind::prismatic) {
      move_twist(eta, p, el.s.joints[op.slot].o);
      p = el.s.joints[op.slot].o;
      joint_step(el, op, eta, turn);
      continue;
    }
    const StiffSlot& k = el.s.stiff[op.slot];
    move_twist(eta, p, k.p);
    const V6 zeta = relative_twist(k, eta, turn, el.heavy && !chain.still);
    eta = eta - zeta;
    p = k.p;
    stiff_step(el, op, zeta, turn + eta.b, active);
  }
  if (chain.group >= 0) {
    move_twist(eta, p, el.s.groups[chain.group].p);
    return group_step(el, chain, eta);
  }
  const Op& op = el.P.ops[chain.first_stiff];
  const StiffSlot& k = el.s.stiff[op.slot];
  move_twist(eta, p, k.p);
  const V3 whole = eta.b;
  for (int i = chain.first; i < chain.first_stiff; ++i)
    if (el.P.ops[i].kind <= OpKind::prismatic && el.P.ops[i].eliminated)
      joint_step(el, el.P.ops[i], eta, turn + whole - eta.b);
  stiff_step(el, op, eta, turn + whole - eta.b, active);
}

/// Takes the last step of the branch wrenches back where nothing else will move.
inline void keep_wrenches(Elimination& el, M still) {
  each_shared_wrench(el.P, el.s, [&](BranchSlot& branch) {
    branch.F = {select(still, branch.before.a, branch.F.a), select(still, branch.before.b, branch.F.b)};
  });
}

}  // namespace stiffmap::kernel
