// SPDX-License-Identifier: MIT
// Load continuation, each lane by its own steps (theory E9): the share of the load that acts, and where to go back to.
#pragma once

#include "slots.hpp"

namespace stiffmap::kernel {

struct LoadSteps {
  const Program& P;
  Scratch& s;
  V factor = splat(1);   ///< of the whole load, in the present step
  V acting = splat(0);   ///< share in the transmitted wrenches: a first step starts from those reached (F11)
  V reached = splat(0);  ///< share that is in equilibrium
  V stride = splat(1);
  V previous = splat(1);  ///< Newton step before, in multiples of the length; 1: none
  V tries = splat(0);     ///< Newton steps at this factor
  V halved = splat(0);    ///< 1: the whole load was not reached in one step
  /// No branches share the load, so the first tangent may know it (F11). Not with hardening laws, whose parameter is a
  /// force: they start from the unloaded slope. Nor with friction, whose signs are those of linear statics.
  const bool at_once = !P.parallel && !P.hardens && (!P.starts_linear || P.bends);

  void begin(M unloaded) {
    acting = select(unloaded, splat(1), acting);
    if (at_once) acting = factor;
    keep(~M{});
  }

  /// Lanes in equilibrium at their factor go on with twice the stride.
  void advance(M lanes) {
    reached = select(lanes, factor, reached);
    stride = select(lanes, stride + stride, stride);
    keep(lanes);
    next(lanes);
  }

  /// Lanes that are not trusted go back and take half the stride; returns those whose stride is too short.
  M halve(M lanes) {
    stride = select(lanes, 0.5 * stride, stride);
    halved = select(lanes, splat(1), halved);
    for (int q = 0; q < P.coordinate_count; ++q) s.z[q] = select(lanes, s.kept[q], s.z[q]);
    for (int k = 0; k < P.chain_count; ++k) s.branches[k].F = select(lanes, s.branches[k].kept, s.branches[k].F);
    next(lanes);
    return lanes & (stride < shortest);
  }

 private:
  static constexpr double shortest = 1.0 / 4;  // beyond that the path is followed in proven steps (load_path.hpp)

  void next(M lanes) {
    const V goal = reached + stride;
    factor = select(lanes, select(goal < 1.0, goal, splat(1)), factor);
    acting = select(lanes, at_once ? factor : reached, acting);
    previous = select(lanes, splat(1), previous);
    tries = select(lanes, splat(0), tries);
  }

  void keep(M lanes) {
    for (int q = 0; q < P.coordinate_count; ++q) s.kept[q] = select(lanes, s.z[q], s.kept[q]);
    for (int k = 0; k < P.chain_count; ++k) s.branches[k].kept = select(lanes, s.branches[k].F, s.branches[k].kept);
  }
};

}  // namespace stiffmap::kernel
