// SPDX-License-Identifier: MIT
// 3-vectors, rotations, frames, wrenches and twists of a block of poses.
#pragma once

#include "lanes.hpp"

namespace stiffmap::kernel {

struct V3 {
  V x, y, z;
};
inline V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V3 operator*(V s, const V3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline V dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline V3 select(M m, const V3& a, const V3& b) {
  return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}

/// Three columns.
struct M3 {
  V3 c[3];
};
inline V3 operator*(const M3& R, const V3& a) { return a.x * R.c[0] + a.y * R.c[1] + a.z * R.c[2]; }
inline M3 operator*(const M3& A, const M3& B) { return {{A * B.c[0], A * B.c[1], A * B.c[2]}}; }
/// Transposed times a vector.
[[gnu::always_inline]] inline V3 operator%(const M3& R, const V3& a) {
  return {dot(R.c[0], a), dot(R.c[1], a), dot(R.c[2], a)};
}

inline V trace(const M3& A) { return A.c[0].x + A.c[1].y + A.c[2].z; }
/// Adds r fᵀ: of lever arms r and forces f, the sum times w is that of r (f·w), its trace that of r·f.
[[gnu::always_inline]] inline void add_lever(M3& sum, const V3& r, const V3& f) {
  sum.c[0] = sum.c[0] + f.x * r;
  sum.c[1] = sum.c[1] + f.y * r;
  sum.c[2] = sum.c[2] + f.z * r;
}

struct Frame {
  V3 p;
  M3 R;
};

/// Wrench (f, m) or twist (v, w): linear first.
struct V6 {
  V3 a, b;
};
inline V6 operator+(const V6& x, const V6& y) { return {x.a + y.a, x.b + y.b}; }
inline V6 operator-(const V6& x, const V6& y) { return {x.a - y.a, x.b - y.b}; }
inline V6 operator*(V s, const V6& x) { return {s * x.a, s * x.b}; }
inline V6 select(M m, const V6& x, const V6& y) { return {select(m, x.a, y.a), select(m, x.b, y.b)}; }
inline V dot(const V6& x, const V6& y) { return dot(x.a, y.a) + dot(x.b, y.b); }

}  // namespace stiffmap::kernel
