// SPDX-License-Identifier: MIT
// Symmetric 6x6 tangents in lanes, blocks A (forces by translations), B (forces by rotations) and
// E (moments by rotations). A tangent here is the symmetric (semitangential) one: the tangent of a
// dead wrench (f, m) is it minus S(m)/2 in the rotational block (docs/fast_path.md F1).
#pragma once

#include "vectors.hpp"

namespace stiffmap::kernel {

struct S3 {  // symmetric 3x3
  V xx, yy, zz, xy, xz, yz;
};
inline S3 operator+(const S3& a, const S3& b) {
  return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
}
inline V3 operator*(const S3& A, const V3& v) {
  return {A.xx * v.x + A.xy * v.y + A.xz * v.z, A.xy * v.x + A.yy * v.y + A.yz * v.z,
          A.xz * v.x + A.yz * v.y + A.zz * v.z};
}

struct Sym6 {
  S3 A;
  M3 B;  // columns: force by unit rotation about x, y, z
  S3 E;
};
inline Sym6 operator+(const Sym6& a, const Sym6& b) {
  return {a.A + b.A, {{a.B.c[0] + b.B.c[0], a.B.c[1] + b.B.c[1], a.B.c[2] + b.B.c[2]}}, a.E + b.E};
}

inline S3 select(M m, const S3& a, const S3& b) {
  return {select(m, a.xx, b.xx), select(m, a.yy, b.yy), select(m, a.zz, b.zz),
          select(m, a.xy, b.xy), select(m, a.xz, b.xz), select(m, a.yz, b.yz)};
}
inline Sym6 select(M m, const Sym6& a, const Sym6& b) {
  return {select(m, a.A, b.A),
          {{select(m, a.B.c[0], b.B.c[0]), select(m, a.B.c[1], b.B.c[1]), select(m, a.B.c[2], b.B.c[2])}},
          select(m, a.E, b.E)};
}

inline V6 operator*(const Sym6& K, const V6& t) { return {K.A * t.a + K.B * t.b, K.B % t.a + K.E * t.b}; }

/// Tangent of the dead wrench with moment m, applied to a twist.
inline V6 dead(const Sym6& K, const V3& m, const V6& t) {
  V6 out = K * t;
  out.b = out.b - splat(0.5) * cross(m, t.b);
  return out;
}

/// K -= u u^T s.
[[gnu::always_inline]] inline void downdate(Sym6& K, const V6& u, V s) {
  const V3 a = s * u.a, b = s * u.b;
  K.A.xx -= a.x * u.a.x;
  K.A.yy -= a.y * u.a.y;
  K.A.zz -= a.z * u.a.z;
  K.A.xy -= a.x * u.a.y;
  K.A.xz -= a.x * u.a.z;
  K.A.yz -= a.y * u.a.z;
  K.B.c[0] = K.B.c[0] - b.x * u.a;
  K.B.c[1] = K.B.c[1] - b.y * u.a;
  K.B.c[2] = K.B.c[2] - b.z * u.a;
  K.E.xx -= b.x * u.b.x;
  K.E.yy -= b.y * u.b.y;
  K.E.zz -= b.z * u.b.z;
  K.E.xy -= b.x * u.b.y;
  K.E.xz -= b.x * u.b.z;
  K.E.yz -= b.y * u.b.z;
}

/// E += s (sym(r f^T) - (f·r) I): the lever arm of a dead force (F3).
[[gnu::always_inline]] inline void add_lever(S3& E, V s, const V3& f, const V3& r) {
  const V h = 0.5 * s, d = s * dot(f, r);
  E.xx += s * r.x * f.x - d;
  E.yy += s * r.y * f.y - d;
  E.zz += s * r.z * f.z - d;
  E.xy += h * (r.x * f.y + r.y * f.x);
  E.xz += h * (r.x * f.z + r.z * f.x);
  E.yz += h * (r.y * f.z + r.z * f.y);
}

/// Moves the reference point by r, rigidly, under the transmitted force f (F2):
/// B' = B + A S(r), E' = E + B^T S(r) - S(r) B' - sym(r f^T) + (f·r) I.
inline void transport(Sym6& K, V6& c, const V3& r, const V3& f) {
  const V3 a0{K.A.xx, K.A.xy, K.A.xz}, a1{K.A.xy, K.A.yy, K.A.yz}, a2{K.A.xz, K.A.yz, K.A.zz};
  const M3 B = K.B;
  // Row i of A S(r) is -(r x row) ... as columns: (A S(r)) e_k = A (r x e_k).
  K.B.c[0] = B.c[0] + (r.z * a1 - r.y * a2);
  K.B.c[1] = B.c[1] + (r.x * a2 - r.z * a0);
  K.B.c[2] = B.c[2] + (r.y * a0 - r.x * a1);
  // E_jk: e_j·(B^T (r x e_k)) - e_j·(r x B'_k)
  const V3 b0 = B.c[0], b1 = B.c[1], b2 = B.c[2];
  const V3 n0 = cross(r, K.B.c[0]), n1 = cross(r, K.B.c[1]), n2 = cross(r, K.B.c[2]);
  // r x e_0 = (0, r.z, -r.y), r x e_1 = (-r.z, 0, r.x), r x e_2 = (r.y, -r.x, 0)
  K.E.xx += (r.z * b0.y - r.y * b0.z) - n0.x;
  K.E.yy += (r.x * b1.z - r.z * b1.x) - n1.y;
  K.E.zz += (r.y * b2.x - r.x * b2.y) - n2.z;
  K.E.xy += (r.x * b0.z - r.z * b0.x) - n1.x;
  K.E.xz += (r.y * b0.x - r.x * b0.y) - n2.x;
  K.E.yz += (r.y * b1.x - r.x * b1.y) - n2.y;
  add_lever(K.E, splat(-1.0), f, r);
  c.b = c.b - cross(r, c.a);
}

/// Full matrix, row by row, for the dense steps.
[[gnu::always_inline]] inline void unpack(const Sym6& K, V (&m)[6][6]) {
  m[0][0] = K.A.xx;
  m[1][1] = K.A.yy;
  m[2][2] = K.A.zz;
  m[0][1] = m[1][0] = K.A.xy;
  m[0][2] = m[2][0] = K.A.xz;
  m[1][2] = m[2][1] = K.A.yz;
  for (int k = 0; k < 3; ++k) {
    m[0][3 + k] = m[3 + k][0] = K.B.c[k].x;
    m[1][3 + k] = m[3 + k][1] = K.B.c[k].y;
    m[2][3 + k] = m[3 + k][2] = K.B.c[k].z;
  }
  m[3][3] = K.E.xx;
  m[4][4] = K.E.yy;
  m[5][5] = K.E.zz;
  m[3][4] = m[4][3] = K.E.xy;
  m[3][5] = m[5][3] = K.E.xz;
  m[4][5] = m[5][4] = K.E.yz;
}

inline void put(const V6& v, V (&out)[6]) {
  out[0] = v.a.x;
  out[1] = v.a.y;
  out[2] = v.a.z;
  out[3] = v.b.x;
  out[4] = v.b.y;
  out[5] = v.b.z;
}
inline V6 get(const V (&v)[6]) { return {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}}; }

/// L D L^T of a symmetric matrix given by its lower part, in place (L below, D on the diagonal);
/// `inverse` receives 1/D, `lowest` the smallest pivot in multiples of `scale`^2.
inline void ldlt(V (&m)[6][6], V (&inverse)[6], V& lowest, const double (&scale)[6]) {
#pragma GCC unroll 6
  for (int j = 0; j < 6; ++j) {
    V w[6];
#pragma GCC unroll 6
    for (int k = 0; k < j; ++k) w[k] = m[j][k] * m[k][k];
    V d = m[j][j];
#pragma GCC unroll 6
    for (int k = 0; k < j; ++k) d -= m[j][k] * w[k];
    m[j][j] = d;
    inverse[j] = 1.0 / d;
    const V relative = d * (1 / (scale[j] * scale[j]));
    lowest = lowest < relative ? lowest : relative;
#pragma GCC unroll 6
    for (int i = j + 1; i < 6; ++i) {
      V s = m[i][j];
#pragma GCC unroll 6
      for (int k = 0; k < j; ++k) s -= m[i][k] * w[k];
      m[i][j] = s * inverse[j];
    }
  }
}

/// Solves with the factors of ldlt, in place.
inline void ldlt_solve(const V (&m)[6][6], const V (&inverse)[6], V (&x)[6]) {
#pragma GCC unroll 6
  for (int i = 1; i < 6; ++i)
#pragma GCC unroll 6
    for (int k = 0; k < i; ++k) x[i] -= m[i][k] * x[k];
#pragma GCC unroll 6
  for (int i = 0; i < 6; ++i) x[i] *= inverse[i];
#pragma GCC unroll 6
  for (int i = 4; i >= 0; --i)
#pragma GCC unroll 6
    for (int k = i + 1; k < 6; ++k) x[i] -= m[k][i] * x[k];
}

}  // namespace stiffmap::kernel
