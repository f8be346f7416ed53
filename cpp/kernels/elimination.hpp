// SPDX-License-Identifier: MIT
// What the passes of the O(n) elimination share (docs/fast_path.md).
#pragma once

#include "slots.hpp"

namespace stiffmap::kernel {

struct Elimination {
  const Program& P;
  Scratch& s;
  V3 gravity;
  V lowest;  ///< smallest pivot, dimensionless: at or below zero the pose is not a plain minimum
  double scale[6];
  bool heavy = false;        ///< there is gravity
  V3 pending = {};           ///< gravity that acts, but is not in the wrenches yet: the first step under a load (F11)
  bool counts = false;       ///< the signs of the pivots are asked
  V negative = splat(0);     ///< negative pivots: directions in which the energy falls (Haynsworth)
  V closest = splat(0);      ///< the pivot next to zero, dimensionless
  V transferred = splat(0);  ///< largest step of a branch's wrench, over stiffness times length

  /// A leg: only its numbers differ from those of the last pass over all, and the others' results are kept.
  static constexpr std::int32_t all = -1, all_anew = -2;  ///< all_anew: keeps the residuals of the last pass over all
  std::int32_t only = all;

  bool skips(const Op& op, int branch) const { return only >= 0 && &op == P.ops + P.legs_op && branch != only; }

  void guard(V pivot, double unit) {
    const V relative = pivot * (1 / (scale[0] * scale[0] * unit * unit));
    lowest = lowest < relative ? lowest : relative;
    if (counts) count(relative);
  }
  void count(V relative) {
    negative = select(relative < 0.0, negative + 1.0, negative);
    closest = absolute(relative) < closest ? absolute(relative) : closest;
  }
};

}  // namespace stiffmap::kernel
