// SPDX-License-Identifier: MIT
// Stands in for cpp/kernels/lanes.hpp: one lane that counts its operations (bench/count.hpp).
#pragma once

#include <cmath>
#include <cstdint>

namespace stiffmap::kernel {

inline constexpr int W = 1;
inline long operations = 0;

struct M {
  std::int64_t m = 0;
  std::int64_t& operator[](int) { return m; }
  std::int64_t operator[](int) const { return m; }
  explicit operator bool() const { return m != 0; }
  M& operator|=(M b) { return m |= b.m, *this; }
  M& operator&=(M b) { return m &= b.m, *this; }
};
inline M operator|(M a, M b) { return {a.m | b.m}; }
inline M operator&(M a, M b) { return {a.m & b.m}; }
inline M operator~(M a) { return {~a.m}; }
inline M operator==(M a, M b) { return {a.m == b.m ? -1 : 0}; }

struct V {
  double v = 0;
  V() = default;
  V(double x) : v(x) {}  // NOLINT: a vector type takes scalars too
  double& operator[](int) { return v; }
  double operator[](int) const { return v; }
  V& operator+=(V b) { return ++operations, v += b.v, *this; }
  V& operator-=(V b) { return ++operations, v -= b.v, *this; }
  V& operator*=(V b) { return ++operations, v *= b.v, *this; }
};
inline V operator+(V a, V b) { return ++operations, V(a.v + b.v); }
inline V operator-(V a, V b) { return ++operations, V(a.v - b.v); }
inline V operator*(V a, V b) { return ++operations, V(a.v * b.v); }
inline V operator/(V a, V b) { return ++operations, V(a.v / b.v); }
inline V operator-(V a) { return V(-a.v); }
inline M operator<(V a, V b) { return {a.v < b.v ? -1 : 0}; }
inline M operator>(V a, V b) { return {a.v > b.v ? -1 : 0}; }
inline M operator<=(V a, V b) { return {a.v <= b.v ? -1 : 0}; }
inline M operator>=(V a, V b) { return {a.v >= b.v ? -1 : 0}; }
inline M operator==(V a, V b) { return {a.v == b.v ? -1 : 0}; }
inline M operator!=(V a, V b) { return {a.v != b.v ? -1 : 0}; }

inline V splat(double x) { return x; }
inline V select(M m, V a, V b) { return m ? a : b; }
inline V absolute(V x) { return std::fabs(x.v); }
inline V larger(V a, V b) { return a.v > b.v ? a : b; }
inline bool any(M m) { return m.m != 0; }
inline bool all(M m) { return m.m != 0; }
inline V root(V x) { return ++operations, V(std::sqrt(x.v)); }
/// As many operations as the real one.
inline void sincos(V x, V& s, V& c) {
  operations += 38;
  s = std::sin(x.v);
  c = std::cos(x.v);
}

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
inline V3 operator%(const M3& R, const V3& a) { return {dot(R.c[0], a), dot(R.c[1], a), dot(R.c[2], a)}; }

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
inline V dot(const V6& x, const V6& y) { return dot(x.a, y.a) + dot(x.b, y.b); }

}  // namespace stiffmap::kernel
