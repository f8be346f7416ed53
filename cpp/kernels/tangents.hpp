// SPDX-License-Identifier: MIT
// Tangents, from the base to the tip (docs/fast_path.md F2-F9). One relative problem per chain: its
// start frame held.
#pragma once

#include "angles.hpp"
#include "groups.hpp"
#include "springs.hpp"
#include "weights.hpp"

namespace stiffmap::kernel {

struct Tangent {
  bool rigid = true;
  Sym6 K;
  V6 c;
  V3 p;
  Turning turning;  ///< only under gravity
  V3 torque;        ///< on the start, from the gaps at the ends of a block's branches: only with `el.exact`
};

/// Moves the tangent to point q; F is the wrench transmitted there. `turns`: the chain's start may, and weights with
/// it.
inline void move(Tangent& t, const V3& q, const V6& F, bool turns) {
  transport(t.K, t.c, q - t.p, F.a);
  if (turns) transport(t.turning, q - t.p);
  t.p = q;
}

/// Rank-one step of a coordinate with row u = K J + g, own stiffness d (F4), coupling to the start's turn s;
/// `pull` is the pending weights' share of its force (F11).
inline void eliminate(Elimination& el, const Op& op, JointSlot& j, V d, const V3& s, V pull, Tangent& t, bool turns) {
  const int q = op.coordinate;
  const V da = el.s.da[q];
  const V pivot = da * d + el.s.dtau[q];
  el.guard(pivot, el.P.coordinates[q].unit);
  j.inverse = 1.0 / pivot;
  const V rho = el.s.tau[q] - dot(j.w, op.kind == OpKind::prismatic ? j.F.a : j.F.b) - pull;
  j.y = (dot(j.J, t.c) - rho) * j.inverse;
  downdate(t.K, j.u, da * j.inverse);
  t.c = t.c - (da * j.y) * j.u;
  j.turn = s;
  if (turns) eliminate(t.turning, j.u, s, da * j.inverse);
}

inline void append_joint(Elimination& el, const Op& op, Tangent& t, bool turns) {
  JointSlot& j = el.s.joints[op.slot];
  if (!op.eliminated || t.rigid) return;
  move(t, j.o, j.F, turns);
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
  eliminate(el, op, j, dot(j.J, KJ), turns ? along(t.turning, j.J) : V3{}, splat(0), t, turns);
}

/// A joint before the first compliance of a chain whose start is held (F6); F at t.p.
inline void prepend_joint(Elimination& el, const Op& op, const V6& F, const V6& hung, Tangent& t) {
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
  d += dot(j.J, KJ);
  V3 s{};
  if (el.heavy) {
    restart(t.turning, j.o);
    s = along(t.turning, j.J);
    if (op.kind == OpKind::revolute) {
      const V3 Mw = t.turning.M * j.w;
      d += dot(j.w, Mw) - 2.0 * dot(s, j.w);
      s = s - Mw + splat(0.5) * cross(j.w, t.turning.moment);  // the turns follow one another
      j.u = j.u - about(t.turning, j.w);
    } else {
      s = s + cross(j.w, t.turning.weight);  // what slides is heavy
    }
  }
  eliminate(el, op, j, d, s, el.heavy ? dot(j.J, hung) : splat(0), t, el.heavy);
}

/// Weights of a chain's bodies that act, but are not in the wrenches yet (F11), about p.
inline V6 pending_weights(const Elimination& el, const Turning& t, const V3& p) {
  const V3 w = t.mass * el.pending;
  return {w, cross(t.lever, el.pending) + cross(t.start - p, w)};
}

/// What comes before the first compliance of a chain that starts at `start`, backwards.
inline void prepend(Elimination& el, const ChainProgram& chain, const V3& start, const V6& F, Tangent& t) {
  V6 hung{};  // pending weights beyond the joint, about t.p
  if (el.heavy) hung = pending_weights(el, t.turning, t.p);
  if (el.exact) hung.b = hung.b - t.torque;
  for (int i = chain.first_stiff - 1; i >= chain.first; --i) {
    const Op& op = el.P.ops[i];
    if (op.kind == OpKind::load) {
      const JointSlot& j = el.s.joints[op.slot];
      if (!el.heavy) continue;
      hang(t.turning, op.mass, splat(op.mass) * el.gravity, j.o + j.w);
      const V3 w = splat(op.mass) * el.pending;
      hung = hung + V6{w, cross(j.o + j.w - t.p, w)};
    } else if (op.eliminated) {
      prepend_joint(el, op, F, hung, t);
    }
  }
  if (el.heavy) restart(t.turning, start);
}

inline Tangent tangent(Elimination& el, const ChainProgram& chain, const V3& start, const V6& F, const V3& end);

/// Newton's exact step where a branch has yet to meet the first one (F17), without gravity: the gap turns with the
/// block's start, and half of the branch's moment with its end (theory E5).
[[gnu::noinline]] inline void turn_gap(const BranchSlot& b, Tangent& t) {
  const V3 gap = b.error.a, none{};
  const V3 turned[3] = {{splat(0), -gap.z, gap.y}, {gap.z, splat(0), -gap.x}, {-gap.y, gap.x, splat(0)}};
  V6 held[3];
  for (int k = 0; k < 3; ++k) {
    held[k] = b.K * V6{turned[k], none};
    t.turning.G[k] = t.turning.G[k] + held[k];
  }
  const auto pair = [&](int i, int k) { return dot(turned[i], held[k].a); };
  t.turning.M = t.turning.M + S3{pair(0, 0), pair(1, 1), pair(2, 2), pair(0, 1), pair(0, 2), pair(1, 2)};
  add_lever(t.turning.M, splat(-1), b.F.a, gap);
  const V3 half = splat(0.5) * cross(b.F.b, b.error.b);
  t.torque = t.torque + cross(gap, (b.K * b.error).a + b.c.a - b.F.a) + half;
  t.c.b = t.c.b + half;
}

/// Relative tangent of a block: sum over its branches, closed to its first one (F8).
inline void block_tangent(Elimination& el, const Op& op, Tangent& t) {
  const V3 start = el.s.stiff[op.slot].start.p;
  for (int b = 0; b < op.count; ++b) {
    BranchSlot& branch = el.s.branches[op.first + b];
    const Tangent own = tangent(el, el.P.chains[op.first + b], start, branch.F, branch.end.p);
    branch.K = own.K;
    branch.c = own.c;
    branch.error = b ? frame_error(branch.end, el.s.branches[op.first].end) : V6{};
    t.K = b ? t.K + own.K : own.K;
    t.c = b ? t.c + own.c + dead(own.K, branch.F.b, branch.error) : own.c;
    if (!el.heavy) continue;
    for (int k = 0; k < 3; ++k) {
      branch.turn[k] = own.turning.G[k];
      t.turning.G[k] = t.turning.G[k] + own.turning.G[k];
    }
    t.turning.M = t.turning.M + own.turning.M;
    t.turning.weight = t.turning.weight + own.turning.weight;
    t.turning.mass += own.turning.mass;
    t.turning.lever = t.turning.lever + own.turning.lever;
    t.turning.moment = t.turning.moment + own.turning.moment;
    if (el.exact && b) turn_gap(branch, t);
  }
}

/// D = K + K_e + [0, S(f); -S(f), 0], factorised in the slot (F7).
inline void factorise(Elimination& el, StiffSlot& k, const Sym6& K, const Tangent& own, bool heavy) {
  const V3 f = k.F.a;
  Sym6 D = K + own.K;
  D.B.c[0] = D.B.c[0] + V3{splat(0), f.z, -f.y};
  D.B.c[1] = D.B.c[1] + V3{-f.z, splat(0), f.x};
  D.B.c[2] = D.B.c[2] + V3{f.y, -f.x, splat(0)};
  if (heavy) {
    const V6* G = own.turning.G;
    for (int i = 0; i < 3; ++i) D.B.c[i] = D.B.c[i] - G[i].a;
    D.E.xx -= 2.0 * G[0].b.x;
    D.E.yy -= 2.0 * G[1].b.y;
    D.E.zz -= 2.0 * G[2].b.z;
    D.E.xy -= G[0].b.y + G[1].b.x;
    D.E.xz -= G[0].b.z + G[2].b.x;
    D.E.yz -= G[1].b.z + G[2].b.y;
  }
  unpack(D, k.L);
  ldlt(k.L, k.inverse, el.lowest, el.scale);
  if (el.counts)
    for (int i = 0; i < 6; ++i) el.count(k.L[i][i] * (1 / (el.scale[i] * el.scale[i])));
}

/// X = K + [0, S(f); 0, S(m)/2] and y, both times L^-1.
inline void couple(StiffSlot& k, const Sym6& K, const V6& y, const Tangent& own, bool heavy) {
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
  for (int q = 0; q < 3 && heavy; ++q) {
    V g[6];
    put(own.turning.G[q], g);
    for (int i = 0; i < 6; ++i) k.X[i][3 + q] -= g[i];
  }
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

/// The same elimination in G and M of the chain (F9); `inner`: the block's own G, null for a spring.
inline void condense(StiffSlot& k, const V6* inner, Turning& t) {
  for (int q = 0; q < 3; ++q) {
    V(&y)[6] = k.turn[q];
    put(inner ? t.G[q] - inner[q] : t.G[q], y);
    V sum[6] = {};
    for (int i = 0; i < 6; ++i) {
      for (int r = 0; r < i; ++r) y[i] -= k.L[i][r] * y[r];
      const V scaled = k.inverse[i] * y[i];
      for (int col = 0; col < 6; ++col) sum[col] += k.X[i][col] * scaled;
    }
    t.G[q] = t.G[q] - get(sum);
  }
  for (int i = 0; i < 6; ++i) downdate(t.M, {k.turn[0][i], k.turn[1][i], k.turn[2][i]}, k.inverse[i]);
}

/// A spring's or block's own tangent; `heavy`: what its weights make of a turn of its start, too.
inline void own_tangent(Elimination& el, const Op& op, const StiffSlot& k, Tangent& t, bool heavy) {
  if (heavy) t.turning.clear(k.start.p);
  if (el.exact) t.torque = V3{};
  if (op.kind == OpKind::spring) spring_tangent(el, op, k, t.K, t.c);
  else block_tangent(el, op, t);
}

/// The first spring or block of a chain, and the joints before it.
inline void begin_stiff(Elimination& el, const ChainProgram& chain, const V3& start, const Op& op, Tangent& t) {
  const StiffSlot& k = el.s.stiff[op.slot];
  own_tangent(el, op, k, t, el.heavy);
  t.rigid = false;
  t.p = k.p;
  prepend(el, chain, start, k.F, t);
}

/// A spring or block behind what came before: its relative twist is eliminated (F7).
inline void append_stiff(Elimination& el, const Op& op, Tangent& t, bool turns) {
  StiffSlot& k = el.s.stiff[op.slot];
  const bool heavy = el.heavy && op.kind == OpKind::block;  // there are weights inside
  Tangent own;
  own_tangent(el, op, k, own, heavy);
  if (heavy) {
    move(t, k.start.p, {k.F.a + own.turning.weight, V3{}}, turns);
    t.K.E = t.K.E + own.turning.M;
    if (turns) append_block(t.turning, own.turning);
    t.c = t.c - pending_weights(el, own.turning, t.p);
    if (el.exact) t.c.b = t.c.b + own.torque;
  }
  move(t, k.p, k.F, turns);
  factorise(el, k, t.K, own, heavy);
  couple(k, t.K, t.c - own.c, own, heavy);
  if (turns) condense(k, heavy ? own.turning.G : nullptr, t.turning);
  condense(k, t.K, t.c);
}

/// A body's weight: transmitted wrench and lever arm change (F9).
inline void append_load(Elimination& el, const Op& op, Tangent& t, bool turns) {
  if (t.rigid) return;
  const JointSlot& j = el.s.joints[op.slot];
  move(t, j.o, j.F, turns);
  add_lever(t.K.E, splat(-op.mass), el.gravity, j.w);
  if (!el.heavy) return;
  if (turns) append_weight(t.turning, op.mass, splat(op.mass) * el.gravity, j.o + j.w, j.o);
  const V3 w = splat(op.mass) * el.pending;
  t.c = t.c - V6{w, cross(j.w, w)};
}

/// Tangent of a chain at point `end` under the end wrench F, its start frame at point `start` held.
inline Tangent tangent(Elimination& el, const ChainProgram& chain, const V3& start, const V6& F, const V3& end) {
  Tangent t;
  const bool turns = el.heavy && !chain.still;
  int from = chain.first;
  if (chain.group >= 0) {
    t.rigid = false;
    group_tangent(el, chain, t.K, t.c);
    t.p = el.s.groups[chain.group].p;
    if (el.heavy) t.turning.clear(start);
    if (turns) group_turning(el, chain, t.turning);
    from = chain.first_stiff + 1;
  }
  for (int i = from; i < chain.first + chain.count; ++i) {
    const Op& op = el.P.ops[i];
    switch (op.kind) {
      case OpKind::revolute:
      case OpKind::prismatic:
        append_joint(el, op, t, turns);
        break;
      case OpKind::spring:
      case OpKind::block:
        if (t.rigid) begin_stiff(el, chain, start, op, t);
        else append_stiff(el, op, t, turns);
        break;
      case OpKind::load:
        append_load(el, op, t, turns);
        break;
    }
  }
  move(t, end, F, turns);
  return t;
}

}  // namespace stiffmap::kernel
