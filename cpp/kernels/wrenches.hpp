// SPDX-License-Identifier: MIT
// Transmitted wrenches, from the tip to the base (docs/fast_path.md F8, F9).
#pragma once

#include "elimination.hpp"

namespace stiffmap::kernel {

inline void shift(V6& F, const V3& from, const V3& to) { F.b = F.b + cross(from - to, F.a); }

inline void block_wrenches(Elimination& el, const Op& op, V6& F, V3& p);

/// From the wrench F at point p of the chain's end to the one at its start point.
inline void wrenches(Elimination& el, const ChainProgram& chain, V6& F, V3& p) {
  for (int i = chain.first + chain.count - 1; i >= chain.first; --i) {
    const Op& op = el.P.ops[i];
    switch (op.kind) {
      case OpKind::revolute:
      case OpKind::prismatic: {
        JointSlot& j = el.s.joints[op.slot];
        shift(F, p, j.o);
        p = j.o;
        j.F = F;
        break;
      }
      case OpKind::spring: {
        StiffSlot& k = el.s.stiff[op.slot];
        shift(F, p, k.p);
        p = k.p;
        k.F = F;
        break;
      }
      case OpKind::block:
        block_wrenches(el, op, F, p);
        break;
      case OpKind::load: {
        JointSlot& j = el.s.joints[op.slot];
        shift(F, p, j.o);
        p = j.o;
        const V3 w = splat(op.mass) * el.gravity;
        F.a = F.a + w;
        F.b = F.b + cross(j.w, w);
        j.F = F;
        break;
      }
    }
  }
}

/// The first branch carries what the others leave.
inline void block_wrenches(Elimination& el, const Op& op, V6& F, V3& p) {
  StiffSlot& k = el.s.stiff[op.slot];
  shift(F, p, k.p);
  k.F = F;
  p = k.start.p;
  BranchSlot& first = el.s.branches[op.first];
  first.F = F;
  V6 start{};
  for (int b = op.count - 1; b >= 0; --b) {
    BranchSlot& branch = el.s.branches[op.first + b];
    if (b > 0) first.F = first.F - branch.F;
    if (el.skips(op, b)) continue;
    V6 Fb = branch.F;
    V3 pb = branch.end.p;
    wrenches(el, el.P.chains[op.first + b], Fb, pb);
    shift(Fb, pb, p);
    if (el.together && b > 0) Fb.b = Fb.b + cross(first.end.p - branch.end.p, branch.F.a);
    start = start + Fb;
  }
  F = start;
}

}  // namespace stiffmap::kernel
