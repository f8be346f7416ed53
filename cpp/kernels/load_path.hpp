// SPDX-License-Identifier: MIT
// The load path of the reference (theory E9) in lanes, for what Newton's first steps do not settle: from the unloaded
// equilibrium in steps that are each proven, a change of stability looked at closely. Each lane is at its own place of
// the path. A lane either iterates at its share of the load, or it looks from an equilibrium where the path goes on:
// with the load ahead in the residual its step is the path's slope times the way, and if the way here is proven, it is
// the first step of the way there.
#pragma once

#include "newton.hpp"

namespace stiffmap::kernel {

struct LoadPath {
  Newton& n;
  M unstable = {};  ///< of the lanes that arrived: the energy falls in some direction
  M ended = {};     ///< lanes whose path of equilibria ends before the whole load

  explicit LoadPath(Newton& newton) : n(newton) {}

  /// Follows the path of `lanes`, which stand at their start; returns those that arrive at the whole load.
  M follow(M lanes, V& iterations) {
    Elimination& e = n.e;
    M active = lanes, done{};
    e.counts = true;
    for (int k = 0; k < most_iterations && any(active); ++k) {
      n.put_load(factor, select(looking, factor + ahead, factor));
      e.negative = splat(0);
      e.closest = splat(1e300);
      n.evaluate(false);
      if (n.P.spring_count > 0) n.pull();
      n.linearize();
      if (n.P.spring_count > 0) n.springs_too();
      V m[6][6];
      n.dense(n.K, m);
      n.invert(m);
      n.step(m, active);
      const V norm = n.step_norm();
      iterations = select(active, iterations + 1.0, iterations);
      const M finite = norm < 1e6;

      // Equilibria: is the way here proven?
      const M judged = active & looking & ~again, first = judged & fresh & finite;
      const M proven = first | (judged & ~fresh & finite & way_proven());
      const M arrived = proven & (factor == 1.0) & ~fresh;
      if (any(proven)) accept(proven);
      if (any(arrived)) {
        keep_wrenches(e, arrived);
        n.take(arrived, m);
        done |= arrived & (e.closest > n.pivot_floor);
      }
      fresh &= ~first;
      active &= ~arrived;
      active &= ~(moment & (e.negative > 0.0));  // counted otherwise there (theory K4): the reference's

      // Newton's step, the first one of a way where the lane has looked.
      const M onward = active & looking & (proven | again), iterating = active & ~looking;
      const M near = norm < n.in.tolerance;
      const M found = iterating & near & ((factor < 1.0) | (norm < n.small) | (previous < n.in.tolerance));
      const M short_enough = finite & (norm <= largest_step) & (tries < most_tries);
      const M shrinks = (norm <= contraction * previous) | (norm <= 1e-7);
      const M sound = (onward & short_enough) | found | (iterating & ~fresh & short_enough & shrinks) |
                      (iterating & fresh & finite & (tries < most_tries));
      n.move(sound);
      const M back = active & ~sound & ~fresh;
      active &= ~(~sound & fresh);  // not even an unloaded equilibrium
      const M starts = onward & sound;
      factor = select(starts, select(ahead < 1.0 - factor, factor + ahead, splat(1)), factor);
      previous = norm;
      tries = select(iterating & ~found, tries + 1.0, splat(1));
      looking = (looking & ~starts) | found;
      again &= ~starts;
      if (any(found)) {
        const V step = factor - reached, left = 1.0 - factor, twice = step + step;
        const V next = select(left > 0.0, select(twice < left, twice, left), step);
        ahead = select(found, select(fresh, splat(0.5), next), ahead);
      }
      if (any(back)) {
        const V failed = select(onward, ahead, factor - reached);
        restore(back);
        ahead = select(back, 0.5 * failed, ahead);
        factor = select(back, reached, factor);
        looking |= back;
        again |= back;
        ended |= back & ((ahead < shortest) | (steps > most_steps));
        active &= ~ended;
      }
    }
    e.counts = false;
    unstable = done & (stable > 0.0);
    return done;
  }

 private:
  static constexpr int most_iterations = 4000;
  static constexpr double contraction = 0.2, largest_step = 0.2, most_tries = 40;
  static constexpr double shortest = 1.0 / 16384, crossing_step = 1.0 / 1024, most_steps = 400;
  static constexpr double bend = 0.1, crossing_bend = 1e-3, bend_noise = 1e-9;

  M moment = n.moment_lanes();
  M looking = {}, again = {};  ///< at an equilibrium; it was looked at before
  M fresh = ~M{};              ///< before the unloaded equilibrium is known
  V factor = splat(0);         ///< share of the load, of the present iterate
  V reached = splat(0);        ///< share whose equilibrium is proven
  V ahead = splat(0);          ///< share on which a lane looks ahead
  V previous = splat(1), tries = splat(0), steps = splat(0);
  V stable = splat(0);  ///< falling directions at the proven equilibrium

  /// The chord against the mean of the tangents at both ends: on another branch they disagree.
  M way_proven() const {
    const Program& P = n.P;
    const Scratch& s = n.s;
    V chord = splat(0), apart = splat(0);
    const V step = factor - reached, forward = 0.5 * step / ahead, backward = 0.5 * step;
    for (int q = 0; q < P.coordinate_count; ++q) {
      const V way = s.z[q] - s.kept[q];
      chord = larger(chord, absolute(way) * P.coordinates[q].unit);
      apart = larger(apart, absolute(way - forward * s.dz[q] - backward * s.slope[q]) * P.coordinates[q].unit);
    }
    const M crossed = n.e.negative != stable;
    const V allowed = select(crossed, splat(crossing_bend), splat(bend));
    return (apart <= bend_noise * P.length + allowed * chord) & ~(crossed & (step > crossing_step));
  }

  /// The equilibrium before the last step is where these lanes go back to.
  void accept(M lanes) {
    Scratch& s = n.s;
    const V slope = 1.0 / ahead;
    for (int q = 0; q < n.P.coordinate_count; ++q) {
      s.kept[q] = select(lanes, s.z[q], s.kept[q]);
      s.slope[q] = select(lanes, slope * s.dz[q], s.slope[q]);
    }
    each_branch([&](BranchSlot& b) { b.kept = select(lanes, b.before, b.kept); });
    reached = select(lanes, factor, reached);
    stable = select(lanes, n.e.negative, stable);
    steps = select(lanes, steps + 1.0, steps);
  }

  void restore(M lanes) {
    Scratch& s = n.s;
    for (int q = 0; q < n.P.coordinate_count; ++q) s.z[q] = select(lanes, s.kept[q], s.z[q]);
    each_branch([&](BranchSlot& b) { b.F = select(lanes, b.kept, b.F); });
  }

  /// Branches whose wrench is a state: the first of a block carries what the others leave.
  template <class Call>
  void each_branch(const Call& call) {
    for (int i = 0; i < n.P.op_count; ++i) {
      const Op& op = n.P.ops[i];
      for (int b = 1; op.kind == OpKind::block && b < op.count; ++b) call(n.s.branches[op.first + b]);
    }
  }
};

}  // namespace stiffmap::kernel
