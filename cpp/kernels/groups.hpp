// SPDX-License-Identifier: MIT
// The six joints with which a chain without spring or block begins: what is before them is rigid, so there is no
// tangent to append the first ones to; together they make one (docs/fast_path.md F12).
#pragma once

#include "elimination.hpp"
#include "weights.hpp"

namespace stiffmap::kernel {

/// The eliminated joints of a chain up to its `first_stiff`, from the base.
struct Group {
  const Op* joint[6] = {};
  bool ball = true;  ///< the last three turn about one point
  Group(const Program& P, const ChainProgram& chain) {
    int k = 0;
    for (int i = chain.first; i <= chain.first_stiff && k < 6; ++i) {
      const Op& op = P.ops[i];
      if (k > 3 && op.actual.has_translation) ball = false;
      if (op.kind > OpKind::prismatic || !op.eliminated) continue;
      if (k > 2 && op.kind == OpKind::prismatic) ball = false;
      joint[k++] = &op;
    }
  }
};

/// Rows of the inverse of three columns, and their determinant.
inline V invert_columns(const V3 (&c)[3], V (&rows)[3][3]) {
  const V3 first = cross(c[1], c[2]), second = cross(c[2], c[0]), third = cross(c[0], c[1]);
  const V size = dot(c[0], first), over = 1.0 / size;
  const V3* const r[3] = {&first, &second, &third};
  for (int a = 0; a < 3; ++a) {
    rows[a][0] = over * r[a]->x;
    rows[a][1] = over * r[a]->y;
    rows[a][2] = over * r[a]->z;
  }
  return size;
}

/// Inverse of a 6x6 by Gauss-Jordan, each lane with its own order of rows; returns the smallest pivot.
inline V invert_by_rows(V (&m)[6][6], V (&x)[6][6]) {
  V lowest = splat(1e300);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) x[i][j] = splat(i == j ? 1 : 0);
  for (int k = 0; k < 6; ++k) {
    for (int i = k + 1; i < 6; ++i) {
      const M swap = absolute(m[i][k]) > absolute(m[k][k]);
      for (int j = k; j < 6; ++j) {
        const V a = m[k][j], b = m[i][j];
        m[k][j] = select(swap, b, a);
        m[i][j] = select(swap, a, b);
      }
      for (int j = 0; j < 6; ++j) {
        const V a = x[k][j], b = x[i][j];
        x[k][j] = select(swap, b, a);
        x[i][j] = select(swap, a, b);
      }
    }
    const V size = absolute(m[k][k]);
    lowest = size < lowest ? size : lowest;
    const V inverse = 1.0 / m[k][k];
    for (int j = k + 1; j < 6; ++j) m[k][j] *= inverse;
    for (int j = 0; j < 6; ++j) x[k][j] *= inverse;
    for (int i = 0; i < 6; ++i) {
      if (i == k) continue;
      const V f = m[i][k];
      for (int j = k + 1; j < 6; ++j) m[i][j] -= f * m[k][j];
      for (int j = 0; j < 6; ++j) x[i][j] -= f * x[k][j];
    }
  }
  return lowest;
}

/// How the generalised forces of the joints turn with the joints: -H of theory (E4), half of the moment turning.
inline void group_stiffness(const Elimination& el, const ChainProgram& chain, const V6& F, const V3& end, V (&A)[6][6],
                            V (&pull)[6]) {
  const Group group(el.P, chain);
  // Of all that acts behind the joint: lever arms times forces, force.
  M3 arms{};
  V3 force = F.a, pending{}, moment{};
  V3 at = end;
  int b = 5;
  for (int i = chain.first_stiff; i >= chain.first && b >= 0; --i) {
    const Op& op = el.P.ops[i];
    const bool joint = op.kind <= OpKind::prismatic;
    if (joint && !op.eliminated) continue;
    const JointSlot& j = el.s.joints[op.slot];
    add_lever(arms, at - j.o, force);
    moment = moment + cross(at - j.o, pending);
    at = j.o;
    if (!joint) {
      const V3 weight = splat(op.mass) * el.gravity, more = splat(op.mass) * el.pending;
      add_lever(arms, j.w, weight);
      force = force + weight;
      moment = moment + cross(j.w, more);
      pending = pending + more;
      continue;
    }
    V3 g;
    if (op.kind == OpKind::prismatic) {
      g = cross(j.w, force);
      pull[b] = dot(j.w, pending);
    } else {
      g = arms * j.w - trace(arms) * j.w + splat(0.5) * cross(j.w, F.b);
      pull[b] = dot(j.w, moment);
    }
    for (int a = 0; a <= b; ++a) {
      const Op& before = *group.joint[a];
      const bool turns = before.kind == OpKind::revolute;
      A[a][b] = turns ? -dot(el.s.joints[before.slot].w, g) : splat(0);
      A[b][a] = A[a][b];
    }
    A[b][b] += el.s.dtau[op.coordinate] / el.s.da[op.coordinate];
    --b;
  }
}

/// Out-of-balance wrench at the end of the group from the joints' out-of-balance forces: J^-T rho.
inline V6 group_residual(Elimination& el, const ChainProgram& chain, const V (&pull)[6]) {
  const Group group(el.P, chain);
  const GroupSlot& k = el.s.groups[chain.group];
  V c[6] = {};
  for (int a = 0; a < 6; ++a) {
    const Op& op = *group.joint[a];
    const JointSlot& j = el.s.joints[op.slot];
    const V rho = el.s.tau[op.coordinate] - dot(j.w, op.kind == OpKind::prismatic ? j.F.a : j.F.b) - pull[a];
    for (int i = 0; i < 6; ++i) c[i] += k.inverse[a][i] * rho;
  }
  return get(c);
}

/// J^-1 where the last three joints turn about the end, so that the others alone move it: blocks in place of rows.
/// Returns what stands for the smallest pivot: determinants over the longest columns.
inline V invert_ball(const Elimination& el, const Group& group, GroupSlot& k, V (&U)[3][3], V (&S)[3][3],
                     V (&T)[3][3]) {
  V3 moves[3], turns[3];
  V longest = splat(0);
  for (int a = 0; a < 3; ++a) {
    const JointSlot& j = el.s.joints[group.joint[a]->slot];
    const bool slides = group.joint[a]->kind == OpKind::prismatic;
    moves[a] = slides ? j.w : cross(j.w, k.p - j.o);
    longest = larger(longest, dot(moves[a], moves[a]));
    turns[a] = el.s.joints[group.joint[3 + a]->slot].w;
  }
  const V moving = invert_columns(moves, U), turning = invert_columns(turns, T);
  for (int i = 0; i < 3; ++i) {
    V3 turned{};  // by the first three joints while the end moves along i
    for (int a = 0; a < 3; ++a)
      if (group.joint[a]->kind == OpKind::revolute) turned = turned + U[a][i] * el.s.joints[group.joint[a]->slot].w;
    for (int a = 0; a < 3; ++a) S[a][i] = -(T[a][0] * turned.x + T[a][1] * turned.y + T[a][2] * turned.z);
  }
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i) {
      k.inverse[a][i] = U[a][i];
      k.inverse[a][3 + i] = splat(0);
      k.inverse[3 + a][i] = S[a][i];
      k.inverse[3 + a][3 + i] = T[a][i];
    }
  const V linear = absolute(moving) / (longest * el.P.length), angular = absolute(turning);
  return linear < angular ? linear : angular;
}

/// J^-T A J^-1 of such a group.
inline void ball_tangent(const V (&A)[6][6], const V (&U)[3][3], const V (&S)[3][3], const V (&T)[3][3], Sym6& K) {
  V X[6][3], Z[3][3];  // A times the columns of J^-1: translations, and rotations of the last three joints
  for (int a = 0; a < 6; ++a)
    for (int i = 0; i < 3; ++i) {
      X[a][i] = A[a][0] * U[0][i] + A[a][3] * S[0][i];
      for (int b = 1; b < 3; ++b) X[a][i] += A[a][b] * U[b][i] + A[a][3 + b] * S[b][i];
      if (a < 3) Z[a][i] = A[3 + a][3] * T[0][i] + A[3 + a][4] * T[1][i] + A[3 + a][5] * T[2][i];
    }
  const auto sum = [](const V(&l)[3][3], int i, const V(*r)[3], int q) {
    return l[0][i] * r[0][q] + l[1][i] * r[1][q] + l[2][i] * r[2][q];
  };
  const auto force = [&](int i, int q) { return sum(U, i, X, q) + sum(S, i, X + 3, q); };
  K.A = {force(0, 0), force(1, 1), force(2, 2), force(0, 1), force(0, 2), force(1, 2)};
  for (int q = 0; q < 3; ++q) K.B.c[q] = {sum(T, q, X + 3, 0), sum(T, q, X + 3, 1), sum(T, q, X + 3, 2)};
  K.E = {sum(T, 0, Z, 0), sum(T, 1, Z, 1), sum(T, 2, Z, 2), sum(T, 0, Z, 1), sum(T, 0, Z, 2), sum(T, 1, Z, 2)};
}

/// Next to a singular configuration: left to the reference; a load path takes negative pivots, but none next to zero.
inline void judge_group(Elimination& el, V pivot) {
  el.lowest = select(pivot > 1e-4, el.lowest, splat(-1));
  if (el.counts) el.closest = select(pivot > 1e-3, el.closest, splat(0));
}

/// Tangent K = J^-T A J^-1 and c at the last joint of the group.
inline void group_tangent(Elimination& el, const ChainProgram& chain, Sym6& K, V6& c) {
  const Group group(el.P, chain);
  GroupSlot& k = el.s.groups[chain.group];
  const JointSlot& last = el.s.joints[group.joint[5]->slot];
  k.p = last.o;
  V A[6][6], pull[6], J[6][6], Y[6][6];
  group_stiffness(el, chain, last.F, k.p, A, pull);
  if (group.ball) {
    V U[3][3], S[3][3], T[3][3];
    judge_group(el, invert_ball(el, group, k, U, S, T));
    ball_tangent(A, U, S, T, K);
    c = group_residual(el, chain, pull);
    return;
  }
  for (int a = 0; a < 6; ++a) {
    const JointSlot& j = el.s.joints[group.joint[a]->slot];
    V column[6];
    put(group.joint[a]->kind == OpKind::prismatic ? V6{j.w, V3{}} : V6{cross(j.w, k.p - j.o), j.w}, column);
    for (int i = 0; i < 6; ++i) J[i][a] = column[i] * (i < 3 ? 1 / el.P.length : 1.0);
  }
  judge_group(el, invert_by_rows(J, k.inverse));
  for (int a = 0; a < 6; ++a)
    for (int i = 0; i < 3; ++i) k.inverse[a][i] *= 1 / el.P.length;
  for (int a = 0; a < 6; ++a)
    for (int i = 0; i < 6; ++i) {
      Y[a][i] = A[a][0] * k.inverse[0][i];
      for (int b = 1; b < 6; ++b) Y[a][i] += A[a][b] * k.inverse[b][i];
    }
  const auto entry = [&](int i, int q) {
    V sum = k.inverse[0][i] * Y[0][q];
    for (int a = 1; a < 6; ++a) sum += k.inverse[a][i] * Y[a][q];
    return sum;
  };
  K.A = {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)};
  for (int q = 0; q < 3; ++q) K.B.c[q] = {entry(0, 3 + q), entry(1, 3 + q), entry(2, 3 + q)};
  K.E = {entry(3, 3), entry(4, 4), entry(5, 5), entry(3, 4), entry(3, 5), entry(4, 5)};
  c = group_residual(el, chain, pull);
}

/// How the weights up to the group's last joint answer to the turn of the chain's start (F9): `t` starts there.
[[gnu::noinline]] inline void group_turning(const Elimination& el, const ChainProgram& chain, Turning& t) {
  const Group group(el.P, chain);
  const GroupSlot& k = el.s.groups[chain.group];
  // Of the bodies behind the joint, as in group_stiffness: sum of lever arm times weight, weight.
  M3 arms{};
  V3 force{}, at = k.p;
  int b = 5;
  for (int i = chain.first_stiff; i >= chain.first; --i) {
    const Op& op = el.P.ops[i];
    const bool joint = op.kind <= OpKind::prismatic;
    if (joint && !op.eliminated) continue;
    const JointSlot& j = el.s.joints[op.slot];
    add_lever(arms, at - j.o, force);
    at = j.o;
    if (!joint) {
      const V3 weight = splat(op.mass) * el.gravity;
      add_lever(arms, j.w, weight);
      force = force + weight;
      hang(t, op.mass, weight, j.o + j.w);
      continue;
    }
    // The joint's force by the turn: W x w of what slides, w (r·W) - r (w·W) of what turns.
    V3 s = cross(force, j.w);
    if (op.kind == OpKind::revolute) s = trace(arms) * j.w - arms * j.w;
    const V(&row)[6] = k.inverse[b--];
    const V3 translation{row[0], row[1], row[2]}, rotation{row[3], row[4], row[5]};
    for (int c = 0; c < 3; ++c) {
      const V by = component(s, c);
      t.G[c] = t.G[c] + V6{by * translation, by * rotation};
    }
  }
}

/// Steps of the group's joints from the twist of its end.
inline void group_step(Elimination& el, const ChainProgram& chain, const V6& eta) {
  const Group group(el.P, chain);
  const GroupSlot& k = el.s.groups[chain.group];
  V e[6];
  put(eta, e);
  for (int a = 0; a < 6; ++a) {
    V step = k.inverse[a][0] * e[0];
    for (int i = 1; i < 6; ++i) step += k.inverse[a][i] * e[i];
    const int q = group.joint[a]->coordinate;
    el.s.dz[q] = step / el.s.da[q];
  }
}

}  // namespace stiffmap::kernel
