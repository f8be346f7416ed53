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
  bool heavy = false;     ///< there is gravity
  V3 pending = {};        ///< gravity that acts, but is not in the wrenches yet: the first step under a load (F11)
  bool counts = false;    ///< the signs of the pivots are asked
  V negative = splat(0);  ///< negative pivots: directions in which the energy falls (Haynsworth)
  V closest = splat(0);   ///< the pivot next to zero, dimensionless
  V product = splat(1), hundreds = splat(0);  ///< of all pivots' sizes: product times ten to the hundreds
  bool exact = false;        ///< the reference's own Newton step, also where loops are open: needs `heavy`
  V transferred = splat(0);  ///< largest step of a branch's wrench, over stiffness times length

  /// A leg: only its numbers differ from those of the last pass over all, and the others' results are kept.
  static constexpr std::int32_t all = -1, all_anew = -2;  ///< all_anew: keeps the residuals of the last pass over all
  std::int32_t only = all;
  bool together = false;  ///< branches pull at the block's end, though their own ends are apart: of a variant (F10)

  bool skips(const Op& op, int branch) const { return only >= 0 && &op == P.ops + P.legs_op && branch != only; }

  void guard(V pivot, double unit) {
    const V relative = pivot * (1 / (scale[0] * scale[0] * unit * unit));
    lowest = lowest < relative ? lowest : relative;
    if (counts) count(relative);
  }
  [[gnu::noinline]] void count(V relative) {
    negative = select(relative < 0.0, negative + 1.0, negative);
    const V size = absolute(relative);
    closest = size < closest ? size : closest;
    product *= size;
    const M low = product < 1e-100, high = product > 1e100;
    product = select(low, 1e100 * product, select(high, 1e-100 * product, product));
    hundreds = select(low, hundreds - 1.0, select(high, hundreds + 1.0, hundreds));
  }
  void count_anew() {
    negative = hundreds = splat(0);
    product = splat(1);
    closest = splat(1e300);
  }
};

}  // namespace stiffmap::kernel
