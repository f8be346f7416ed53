// SPDX-License-Identifier: MIT
// Errors of commanded coordinates (theory G1).
#pragma once

#include "angles.hpp"
#include "program.hpp"

namespace stiffmap::kernel {

/// (coordinate, error) pairs at `knots`, straight between them and level beyond the ends.
inline V between_knots(const double* knots, int count, V u) {
  V out = splat(knots[1]);
  for (const double *a = knots, *last = knots + 2 * (count - 1); a < last; a += 2) {
    const V share = (u - a[0]) * (1 / (a[2] - a[0]));
    out = select(u >= a[0], a[1] + select(share < 1.0, share, splat(1)) * (a[3] - a[1]), out);
  }
  return out;
}

/// The error of one entry where its drive is commanded to stand at `commanded`.
inline V command_error(const Program& P, const CommandErrorProgram& k, V commanded) {
  const V u = commanded - k.reference;
  V wave = splat(0), unused;
  if (k.amplitude != 0) sincos(u * (2 * 3.14159265358979323846 / k.period) + k.phase, wave, unused);
  V out = k.offset + k.slope * u + k.amplitude * wave;
  if (k.count) out += between_knots(P.error_knots + 2 * k.first, k.count, commanded);
  return out;
}

}  // namespace stiffmap::kernel
