// SPDX-License-Identifier: MIT
// Wrench and tangent of a link spring (docs/fast_path.md F5).
#pragma once

#include "elimination.hpp"

namespace stiffmap::kernel {

inline void add_outer(S3& S, const V3& a, const V3& b) {
  S.xx += a.x * b.x;
  S.yy += a.y * b.y;
  S.zz += a.z * b.z;
  S.xy += a.x * b.y;
  S.xz += a.x * b.z;
  S.yz += a.y * b.z;
}

/// Entries of a spring's stiffness: the same for all lanes, or one that varies from pose to pose.
struct Entries {
  const double* k;
  bool none(int i) const { return k[i] == 0; }
  V operator()(int i) const { return splat(k[i]); }
};
struct LaneEntries {
  const double* pattern;  ///< zero where all poses have zero
  const V* k;
  bool none(int i) const { return pattern[i] == 0; }
  V operator()(int i) const { return k[i]; }
};

/// S += sum_ij k_ij c_i c_j^T for a symmetric k, zero entries skipped; h adds to (01), (02), (12).
template <class K>
void add_pairs(S3& S, const M3& C, const V* diagonal, const K& k, int row, int column, const V3& h) {
  for (int i = 0; i < 3; ++i) {
    const V3 a = diagonal[i] * C.c[i];
    add_outer(S, a, C.c[i]);
  }
  const bool turning = row == 3;
  for (int i = 0; i < 3; ++i)
    for (int q = i + 1; q < 3; ++q) {
      const int at = 6 * (row + i) + column + q;
      if (k.none(at) && !turning) continue;
      V e = k(at);
      if (turning) e += i + q == 1 ? h.x : i + q == 2 ? h.y : h.z;
      const V3 a = e * C.c[i], b = e * C.c[q];
      add_outer(S, a, C.c[q]);
      add_outer(S, b, C.c[i]);
    }
}

template <class K>
V6 spring_wrench(Elimination& el, const Op& op, const StiffSlot& k, const K& entries) {
  const V* x = el.s.x + op.coordinate;
  V d[6], tau[6];
  for (int i = 0; i < 6; ++i) {
    d[i] = x[i] - op.rest[i];
    tau[i] = el.P.coordinates[op.coordinate + i].law >= 0 ? el.s.tau[op.coordinate + i] : splat(0);
  }
  for (int i = 0; i < 6; ++i)
    for (int q = 0; q < 6; ++q)
      if (!entries.none(6 * i + q)) tau[i] += entries(6 * i + q) * d[q];
  return {k.start.R * V3{tau[0], tau[1], tau[2]}, k.Z * V3{tau[3], tau[4], tau[5]}};
}

/// Wrench at k.p with which a spring holds its end.
inline V6 spring_wrench(Elimination& el, const Op& op, const StiffSlot& k) {
  if (op.stroke < 0) return spring_wrench(el, op, k, Entries{op.K});
  return spring_wrench(el, op, k, LaneEntries{op.K, el.s.strokes[op.stroke].K});
}

template <class E>
void spring_tangent(Elimination& el, const Op& op, const StiffSlot& k, const E& entries, Sym6& K, V6& c) {
  V diagonal[6];
  for (int i = 0; i < 6; ++i) {
    diagonal[i] = entries(7 * i);
    const int q = op.coordinate + i;
    if (el.P.coordinates[q].law < 0) continue;
    diagonal[i] += el.P.starts_linear ? el.s.dtau[q] / el.s.da[q] : el.s.dtau[q];  // by the deflection
  }
  const M3& R = k.start.R;
  const M3& Z = k.Z;
  K = Sym6{};
  add_pairs(K.A, R, diagonal, entries, 0, 0, V3{});
  // The moment turns with the axes in sequence: H_ij = m·(w_i x w_j)/2 for i < j. Z is dual to the
  // axes w, and w_1 is both.
  const V3 w0 = R.c[0], w1 = Z.c[1], n = cross(Z.c[0], Z.c[1]);
  const V3 w2 = (1.0 / dot(n, Z.c[2])) * n;
  const V3 m = k.F.b;
  const V3 h{-0.5 * dot(m, cross(w0, w1)), -0.5 * dot(m, cross(w0, w2)), -0.5 * dot(m, cross(w1, w2))};
  add_pairs(K.E, Z, diagonal + 3, entries, 3, 3, h);
  for (int i = 0; i < 3; ++i)
    for (int q = 0; q < 3; ++q) {
      if (entries.none(6 * i + 3 + q)) continue;
      const V3 f = entries(6 * i + 3 + q) * R.c[i];
      K.B.c[0] = K.B.c[0] + Z.c[q].x * f;
      K.B.c[1] = K.B.c[1] + Z.c[q].y * f;
      K.B.c[2] = K.B.c[2] + Z.c[q].z * f;
    }
  c = spring_wrench(el, op, k, entries) - k.F;
}

/// Relative tangent K, c at k.p of a spring, its start held (F5).
inline void spring_tangent(Elimination& el, const Op& op, const StiffSlot& k, Sym6& K, V6& c) {
  if (op.stroke < 0) spring_tangent(el, op, k, Entries{op.K}, K, c);
  else spring_tangent(el, op, k, LaneEntries{op.K, el.s.strokes[op.stroke].K}, K, c);
}

}  // namespace stiffmap::kernel
