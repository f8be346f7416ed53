// SPDX-License-Identifier: MIT
// At the platform: the inverse of its tangent, and the answer that each lane keeps of it.
#pragma once

#include "elimination.hpp"
#include "sym6.hpp"

namespace stiffmap::kernel {

struct Answer {
  Sym6 K;              ///< symmetric, at the point
  V compliance[6][6];  ///< inverse of the tangent of a dead wrench
  bool taken = false;  ///< by some lane
  Answer() {}          // not filled with zeros: 4 kB

  void take(M lanes, const Sym6& now, const V (&inverse)[6][6]) {
    K = taken ? select(lanes, now, K) : now;
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j)
        compliance[i][j] = taken ? select(lanes, inverse[i][j], compliance[i][j]) : inverse[i][j];
    taken = true;
  }
};

/// Inverse without pivoting: the symmetric part is positive definite where it is used.
[[gnu::always_inline]] inline void invert(Elimination& e, V (&m)[6][6]) {
  V x[6][6];
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) x[i][j] = splat(i == j ? 1 : 0);
  for (int k = 0; k < 6; ++k) {
    const V relative = m[k][k] * (1 / (e.scale[k] * e.scale[k]));
    e.lowest = e.lowest < relative ? e.lowest : relative;
    if (e.counts) e.count(relative);
    const V inverse = 1.0 / m[k][k];
    for (int j = 0; j < 6; ++j) {
      if (j > k) m[k][j] *= inverse;
      if (j <= k) x[k][j] *= inverse;
    }
    for (int i = 0; i < 6; ++i) {
      if (i == k) continue;
      const V f = m[i][k];
      for (int j = 0; j < 6; ++j) {
        if (j > k) m[i][j] -= f * m[k][j];
        if (j <= k) x[i][j] -= f * x[k][j];
      }
    }
  }
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) m[i][j] = x[i][j];
}

}  // namespace stiffmap::kernel
