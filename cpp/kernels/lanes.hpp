// SPDX-License-Identifier: MIT
// One number for each of W poses at once. GCC's vector types compile to SSE2, AVX2, AVX-512 or NEON;
// W follows the level that this file is compiled for (docs/fast_path.md).
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>

#ifndef STIFFMAP_LANES
#define STIFFMAP_LANES 2
#endif

namespace stiffmap::kernel {

inline constexpr int W = STIFFMAP_LANES;
using V = double __attribute__((vector_size(8 * W)));
using M = std::int64_t __attribute__((vector_size(8 * W)));  // lane masks: all bits set or none

inline V splat(double x) { return V{} + x; }
inline M bits(std::uint32_t which) { return M{} + static_cast<std::int64_t>(which); }
inline V select(M m, V a, V b) { return m ? a : b; }
inline V absolute(V x) { return x < 0.0 ? -x : x; }
inline V larger(V a, V b) { return a > b ? a : b; }
inline bool any(M m) {
  std::int64_t out = 0;
  for (int i = 0; i < W; ++i) out |= m[i];
  return out != 0;
}
inline bool all(M m) {
  std::int64_t out = -1;
  for (int i = 0; i < W; ++i) out &= m[i];
  return out != 0;
}
inline V root(V x) {
  V out{};
  for (int i = 0; i < W; ++i) out[i] = __builtin_sqrt(x[i]);
  return out;
}

inline V load(const double* x) {
  V out;
  __builtin_memcpy(&out, x, sizeof out);
  return out;
}

#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define STIFFMAP_SHUFFLES
/// Of two vectors' 2H by 2H blocks: the upper halves of `low` and the lower halves of `high` change places.
template <int H, int... I>
inline void exchange(V& low, V& high, std::integer_sequence<int, I...>) {
  const V a = low, b = high;
  low = __builtin_shufflevector(a, b, ((I & H) ? W + I - H : I)...);
  high = __builtin_shufflevector(a, b, ((I & H) ? W + I : I + H)...);
}

template <int H>
[[gnu::always_inline]] inline void transpose(V (&rows)[W]) {
  if constexpr (H > 0) {
#pragma GCC unroll 8
    for (int i = 0; i < W; ++i)
      if (!(i & H)) exchange<H>(rows[i], rows[i + H], std::make_integer_sequence<int, W>{});
    transpose<H / 2>(rows);
  }
}
#endif
#endif

/// Calls put(lane) for each of `lanes`; all of them, the usual case, without asking each.
template <class Put>
[[gnu::always_inline]] inline void each_lane(M lanes, const Put& put) {
  if (all(lanes)) {
#pragma GCC unroll 8
    for (int i = 0; i < W; ++i) put(i);
    return;
  }
  for (int i = 0; i < W; ++i)
    if (lanes[i]) put(i);
}

#ifdef STIFFMAP_SHUFFLES
/// Fewer than W numbers of each lane.
template <int count>
[[gnu::noinline]] inline void write_few(const V* values, M lanes, double* const (&out)[W]) {
  V rows[W] = {};
  for (int k = 0; k < count; ++k) rows[k] = values[k];
  transpose<W / 2>(rows);
  each_lane(lanes, [&](int i) { __builtin_memcpy(out[i], &rows[i], sizeof(double) * count); });
}
#endif

/// Writes `count` numbers of each lane in `lanes` to out[lane], one after the other.
inline void write_lanes(const V* values, int count, M lanes, double* const (&out)[W]) {
  int from = 0;
#ifdef STIFFMAP_SHUFFLES
  if constexpr (W > 6)
    if (count == 6) return write_few<6>(values, lanes, out);
  // The last W of them again where they are no multiple of W.
  for (; from < count && count >= W; from += W) {
    if (from > count - W) from = count - W;
    V rows[W];
    for (int k = 0; k < W; ++k) rows[k] = values[from + k];
    transpose<W / 2>(rows);
    each_lane(lanes, [&](int i) { __builtin_memcpy(out[i] + from, &rows[i], sizeof(V)); });
  }
#endif
  for (; from < count; ++from)
    for (int i = 0; i < W; ++i)
      if (lanes[i]) out[i][from] = values[from][i];
}

/// The real root of u^3 + u = y by three of Halley's steps: from y, or from a cube root by the exponent (at most 6 %
/// too large) where that is smaller, the first leaves an error of at most 1.5 %, the second 5e-7, the third round-off.
inline V cubic_root(V y) {
  const V size = absolute(y);
  M bits;
  __builtin_memcpy(&bits, &size, sizeof bits);
  bits = __builtin_convertvector(__builtin_convertvector(bits, V) * (1.0 / 3), M) + 0x2AA0000000000000;
  V u;
  __builtin_memcpy(&u, &bits, sizeof u);
  u = u < size ? u : size;
  for (int k = 0; k < 3; ++k) {
    const V square = u * u, error = (square + 1.0) * u - size, slope = 3.0 * square + 1.0;
    u -= error * slope / (slope * slope - 3.0 * u * error);
  }
  return y < 0.0 ? -u : u;
}

/// Sine and cosine: reduction to |r| <= pi/4 in three parts, then the Taylor-like minimax polynomials
/// of degree 13 and 14; error below 2 ulp for |x| < 1e4.
inline void sincos(V x, V& s, V& c) {
  constexpr double two_over_pi = 0.63661977236758134308;
  constexpr double a = 1.57079632673412561417e+00, b = 6.07710050630396597660e-11, d = 2.02226624879595063154e-21;
  constexpr double shift = 6755399441055744.0;  // 1.5 * 2^52: rounds to the nearest whole number
  const V k = (x * two_over_pi + shift) - shift;
  const V r = ((x - k * a) - k * b) - k * d;
  const V z = r * r;
  const V ps = r + r * z *
                       (-1.66666666666666324348e-01 +
                        z * (8.33333333332248946124e-03 +
                             z * (-1.98412698298579493134e-04 +
                                  z * (2.75573137070700676789e-06 +
                                       z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
  const V pc = 1.0 - 0.5 * z +
               z * z *
                   (4.16666666666666019037e-02 +
                    z * (-1.38888888888741095749e-03 +
                         z * (2.48015872894767294178e-05 +
                              z * (-2.75573143513906633035e-07 +
                                   z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
  const M q = __builtin_convertvector(k, M);
  const M swap = (q & 1) != 0, negs = (q & 2) != 0, negc = ((q + 1) & 2) != 0;
  const V s0 = swap ? pc : ps, c0 = swap ? ps : pc;
  s = negs ? -s0 : s0;
  c = negc ? -c0 : c0;
}

}  // namespace stiffmap::kernel
