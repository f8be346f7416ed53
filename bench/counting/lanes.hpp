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
  V& operator/=(V b) { return ++operations, v /= b.v, *this; }
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
inline M bits(std::uint32_t which) { return {which}; }
inline V select(M m, V a, V b) { return m ? a : b; }
inline V absolute(V x) { return std::fabs(x.v); }
inline V larger(V a, V b) { return a.v > b.v ? a : b; }
inline bool any(M m) { return m.m != 0; }
inline bool all(M m) { return m.m != 0; }
inline V root(V x) { return ++operations, V(std::sqrt(x.v)); }
inline V load(const double* x) { return *x; }
template <class Put>
inline void each_lane(M lanes, const Put& put) {
  if (lanes) put(0);
}
inline void write_lanes(const V* values, int count, M lanes, double* const (&out)[W]) {
  for (int i = 0; lanes[0] && i < count; ++i) out[0][i] = values[i].v;
}
/// As many operations as the real one.
inline V cubic_root(V y) {
  operations += 38;
  double u = std::cbrt(y.v);
  for (int k = 0; k < 60; ++k) u = (2 * u * u * u + y.v) / (3 * u * u + 1);
  return u;
}
/// As many operations as the real one.
inline void sincos(V x, V& s, V& c) {
  operations += 38;
  s = std::sin(x.v);
  c = std::cos(x.v);
}

}  // namespace stiffmap::kernel
