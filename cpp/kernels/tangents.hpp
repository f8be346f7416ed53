// SPDX-License-Identifier: MIT
// Tangents, from the base to the tip (docs/fast_path.md F2-F9). One relative problem per chain: its
// start frame held.
#pragma once

#include "angles.hpp"
#include "springs.hpp"

namespace stiffmap::kernel {

struct Tangent {
  bool rigid = true;
  Sym6 K;
  V6 c;
  V3 p;
  int prefix[16];
  int prefixed = 0;
};

/// Moves the tangent to point q; F is the wrench transmitted there.
inline void move(Tangent& t, const V3& q, const V6& F) {
  transport(t.K, t.c, q - t.p, F.a);
  t.p = q;
}

/// Rank-one step of a coordinate with row u = K J + g, own stiffness d (F4).
inline void eliminate(Elimination& el, const Op& op, JointSlot& j, V d, Tangent& t) {
  const int q = op.coordinate;
  const V da = el.s.da[q];
  const V pivot = da * d + el.s.dtau[q];
  el.guard(pivot, el.P.coordinates[q].unit);
  j.inverse = 1.0 / pivot;
  const V rho = el.s.tau[q] - dot(j.w, op.kind == OpKind::prismatic ? j.F.a : j.F.b);
  j.y = (dot(j.J, t.c) - rho) * j.inverse;
  downdate(t.K, j.u, da * j.inverse);
  t.c = t.c - (da * j.y) * j.u;
}

inline void append_joint(Elimination& el, const Op& op, Tangent& t) {
  JointSlot& j = el.s.joints[op.slot];
  if (!op.eliminated) return;
  if (t.rigid) {
    t.prefix[t.prefixed++] = static_cast<int>(&op - el.P.ops);
    return;
  }
  move(t, j.o, j.F);
  V6 g{};
  if (op.kind == OpKind::prismatic) {
    j.J = {j.w, V3{}};
    g.b = cross(j.w, j.F.a);
  } else {
    j.J = {V3{}, j.w};
    g.b = splat(0.5) * cross(j.w, j.F.b);
  }
  const V6 KJ = t.K * j.J;
  j.u = KJ + g;
  eliminate(el, op, j, dot(j.J, KJ), t);
}

/// A joint before the first compliance of a chain whose start is held (F6); F at t.p.
inline void prepend_joint(Elimination& el, const Op& op, const V6& F, Tangent& t) {
  JointSlot& j = el.s.joints[op.slot];
  V6 g{};
  V d{};
  if (op.kind == OpKind::prismatic) {
    j.J = {j.w, V3{}};
  } else {
    j.J = {cross(j.w, t.p - j.o), j.w};
    g = {cross(F.a, j.w), splat(-0.5) * cross(j.w, F.b)};
    d = dot(F.a, cross(j.w, j.J.a));
  }
  const V6 KJ = t.K * j.J;
  j.u = KJ + g;
  eliminate(el, op, j, dot(j.J, KJ) + d, t);
}

inline void tangent(Elimination& el, const ChainProgram& chain, const V6& F, const V3& end, Sym6& K, V6& c);

/// Relative tangent of a block: sum over its branches, closed to its first one (F8).
inline void block_tangent(Elimination& el, const Op& op, Sym6& K, V6& c) {
  for (int b = 0; b < op.count; ++b) {
    BranchSlot& branch = el.s.branches[op.first + b];
    tangent(el, el.P.chains[op.first + b], branch.F, branch.end.p, branch.K, branch.c);
    if (b == 0) {
      branch.error = V6{};
      K = branch.K;
      c = branch.c;
      continue;
    }
    branch.error = frame_error(branch.end, el.s.branches[op.first].end);
    K = K + branch.K;
    c = c + branch.c + dead(branch.K, branch.F.b, branch.error);
  }
}

/// D = K + K_e + [0, S(f); -S(f), 0], factorised in the slot (F7).
inline void factorise(Elimination& el, StiffSlot& k, const Sym6& K, const Sym6& own) {
  const V3 f = k.F.a;
  Sym6 D = K + own;
  D.B.c[0] = D.B.c[0] + V3{splat(0), f.z, -f.y};
  D.B.c[1] = D.B.c[1] + V3{-f.z, splat(0), f.x};
  D.B.c[2] = D.B.c[2] + V3{f.y, -f.x, splat(0)};
  unpack(D, k.L);
  ldlt(k.L, k.inverse, el.lowest, el.scale);
}

/// X = K + [0, S(f); 0, S(m)/2] and y, both times L^-1.
inline void couple(StiffSlot& k, const Sym6& K, const V6& y) {
  const V3 f = k.F.a, h = splat(0.5) * k.F.b;
  unpack(K, k.X);
  k.X[0][4] -= f.z;
  k.X[0][5] += f.y;
  k.X[1][3] += f.z;
  k.X[1][5] -= f.x;
  k.X[2][3] -= f.y;
  k.X[2][4] += f.x;
  k.X[3][4] -= h.z;
  k.X[3][5] += h.y;
  k.X[4][3] += h.z;
  k.X[4][5] -= h.x;
  k.X[5][3] -= h.y;
  k.X[5][4] += h.x;
  put(y, k.y);
#pragma GCC unroll 6
  for (int i = 1; i < 6; ++i)
#pragma GCC unroll 6
    for (int q = 0; q < i; ++q) {
#pragma GCC unroll 6
      for (int col = 0; col < 6; ++col) k.X[i][col] -= k.L[i][q] * k.X[q][col];
      k.y[i] -= k.L[i][q] * k.y[q];
    }
}

/// K -= X^T D^-1 X, c -= X^T D^-1 y.
inline void condense(const StiffSlot& k, Sym6& K, V6& c) {
  V row[6][6], full[6];
  for (int i = 0; i < 6; ++i)
    for (int col = 0; col < 6; ++col) row[i][col] = k.inverse[i] * k.X[i][col];
  const auto product = [&](int a, int b) {
    V sum = row[0][a] * k.X[0][b];
    for (int i = 1; i < 6; ++i) sum += row[i][a] * k.X[i][b];
    return sum;
  };
  K.A.xx -= product(0, 0);
  K.A.yy -= product(1, 1);
  K.A.zz -= product(2, 2);
  K.A.xy -= product(0, 1);
  K.A.xz -= product(0, 2);
  K.A.yz -= product(1, 2);
  for (int q = 0; q < 3; ++q) {
    K.B.c[q].x -= product(0, 3 + q);
    K.B.c[q].y -= product(1, 3 + q);
    K.B.c[q].z -= product(2, 3 + q);
  }
  K.E.xx -= product(3, 3);
  K.E.yy -= product(4, 4);
  K.E.zz -= product(5, 5);
  K.E.xy -= product(3, 4);
  K.E.xz -= product(3, 5);
  K.E.yz -= product(4, 5);
  for (int col = 0; col < 6; ++col) {
    full[col] = row[0][col] * k.y[0];
    for (int i = 1; i < 6; ++i) full[col] += row[i][col] * k.y[i];
  }
  c = c - get(full);
}

/// A spring or block behind what came before: its relative twist is eliminated (F7).
inline void append_stiff(Elimination& el, const Op& op, Tangent& t) {
  StiffSlot& k = el.s.stiff[op.slot];
  Sym6 own;
  V6 c;
  if (op.kind == OpKind::spring) spring_tangent(el, op, k, own, c);
  else block_tangent(el, op, own, c);
  if (t.rigid) {
    t.rigid = false;
    t.K = own;
    t.c = c;
    t.p = k.p;
    for (int i = t.prefixed - 1; i >= 0; --i) prepend_joint(el, el.P.ops[t.prefix[i]], k.F, t);
    return;
  }
  move(t, k.p, k.F);
  factorise(el, k, t.K, own);
  couple(k, t.K, t.c - c);
  condense(k, t.K, t.c);
}

/// A body's weight: transmitted wrench and lever arm change (F9).
inline void append_load(Elimination& el, const Op& op, Tangent& t) {
  if (t.rigid) return;
  const JointSlot& j = el.s.joints[op.slot];
  move(t, j.o, j.F);
  add_lever(t.K.E, splat(-op.mass), el.gravity, j.w);
}

/// Tangent of a chain at point `end` under the end wrench F, its start held.
inline void tangent(Elimination& el, const ChainProgram& chain, const V6& F, const V3& end, Sym6& K, V6& c) {
  Tangent t;
  for (int i = chain.first; i < chain.first + chain.count; ++i) {
    const Op& op = el.P.ops[i];
    switch (op.kind) {
      case OpKind::revolute:
      case OpKind::prismatic:
        append_joint(el, op, t);
        break;
      case OpKind::spring:
      case OpKind::block:
        append_stiff(el, op, t);
        break;
      case OpKind::load:
        append_load(el, op, t);
        break;
    }
  }
  move(t, end, F);
  K = t.K;
  c = t.c;
}

}  // namespace stiffmap::kernel
