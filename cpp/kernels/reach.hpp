// SPDX-License-Identifier: MIT
// A certain no for poses out of reach, at the price of a few products (docs/fast_path.md, Closure).
#pragma once

#include "program.hpp"
#include "vectors.hpp"

namespace stiffmap::kernel {

inline constexpr double reach_margin = 1e-6;  // of the length: next to the border the reference decides

/// Lanes where a leg would have to be longer than it is. Not inlined, as it must not change the code around it.
[[gnu::noinline]] inline M beyond_reach(const Program& P, const Frame& tip) {
  M no{};
  for (int k = 0; k < P.leg_count; ++k) {
    const ReachProgram& leg = P.reach[k];
    if (!leg.known) continue;
    V3 way = tip.p + tip.R * V3{splat(leg.last[0]), splat(leg.last[1]), splat(leg.last[2])} -
             V3{splat(leg.first[0]), splat(leg.first[1]), splat(leg.first[2])};
    for (int i = 0; i < leg.slides; ++i) {
      const V3 along{splat(leg.along[i][0]), splat(leg.along[i][1]), splat(leg.along[i][2])};
      way = way - dot(way, along) * along;
    }
    const double most = leg.length + reach_margin * P.length;
    no |= dot(way, way) > most * most;
  }
  return no;
}

}  // namespace stiffmap::kernel
