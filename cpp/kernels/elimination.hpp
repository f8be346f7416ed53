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
  V transferred = splat(0);  ///< largest step of a branch's wrench, over stiffness times length

  void guard(V pivot, double unit) {
    const V relative = pivot * (1 / (scale[0] * scale[0] * unit * unit));
    lowest = lowest < relative ? lowest : relative;
  }
};

}  // namespace stiffmap::kernel
