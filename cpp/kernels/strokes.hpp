// SPDX-License-Identifier: MIT
// Springs that vary with a joint's coordinate, at the commanded pose (docs/fast_path.md F13).
#pragma once

#include "slots.hpp"

namespace stiffmap::kernel {

inline constexpr double stroke_margin = 1e-9;  // of the length or range: next to the border the reference decides

/// A beam: stiffness over powers of its length.
inline M beam_stroke(const StrokeProgram& t, const double* K, V u, V (&out)[36]) {
  const V longer = 1.0 + t.rate / t.length * (u - t.at);
  V power[3];
  power[0] = 1.0 / longer;
  power[1] = power[0] * power[0];
  power[2] = power[1] * power[0];
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k) {
      const int p = (i < 3 && i != t.along) + (k < 3 && k != t.along);
      out[6 * i + k] = K[6 * i + k] * power[p];
    }
  return longer > 0.0;
}

/// A table: inverse of the compliance between two rows.
inline M table_stroke(const Program& P, const StrokeProgram& t, V u, V (&out)[36]) {
  const double* rows = P.stroke_rows + stroke_row * t.first;
  const double* last = rows + stroke_row * (t.count - 1);
  V C[6][6] = {}, inverse[6], lowest = splat(0);
  for (int r = 0; r + 1 < t.count; ++r) {
    const double *a = rows + stroke_row * r, *b = a + stroke_row;
    const M here = u >= (r ? a[0] : a[0] - t.slack);
    const V share = (u - a[0]) * (1 / (b[0] - a[0]));
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k <= i; ++k) {
        const int e = 1 + 6 * i + k;
        C[i][k] = select(here, a[e] + share * (b[e] - a[e]), C[i][k]);
      }
  }
  constexpr double one[6] = {1, 1, 1, 1, 1, 1};
  ldlt(C, inverse, lowest, one);
  for (int k = 0; k < 6; ++k) {
    V x[6] = {};
    x[k] = splat(1);
    ldlt_solve(C, inverse, x);
    for (int i = 0; i < 6; ++i) out[6 * i + k] = x[i];
  }
  return (u >= rows[0] - t.slack) & (u <= last[0] + t.slack);
}

/// Stiffness of every such spring of a program; lanes in which all are declared.
inline M set_strokes(const Program& P, Scratch& s) {
  M known = splat(0) == splat(0);
  for (int i = 0; i < P.stroke_count; ++i) {
    const StrokeProgram& t = P.strokes[i];
    const V u = s.closed[t.coordinate];
    V(&K)[36] = s.strokes[i].K;
    known &= t.count ? table_stroke(P, t, u, K) : beam_stroke(t, P.ops[t.op].K, u, K);
  }
  return known;
}

/// Lanes that command a stroke beyond what is declared, and not by round-off: such a ram is not there.
[[gnu::noinline]] inline M beyond_strokes(const Program& P, const Scratch& s) {
  M no{};
  for (int i = 0; i < P.stroke_count; ++i) {
    const StrokeProgram& t = P.strokes[i];
    const V u = s.closed[t.coordinate];
    if (t.count == 0) {
      no |= 1.0 + t.rate / t.length * (u - t.at) < -stroke_margin;
      continue;
    }
    const double low = P.stroke_rows[stroke_row * t.first], high = P.stroke_rows[stroke_row * (t.first + t.count - 1)];
    const double margin = t.slack + stroke_margin * (high - low);
    no |= (u < low - margin) | (u > high + margin);
  }
  return no;
}

}  // namespace stiffmap::kernel
