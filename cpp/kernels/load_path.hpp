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

  /// Follows the path of `lanes`, which stand at their start; returns those that arrive at the whole load. `restart`
  /// puts lanes back to their start.
  template <class Restart>
  M follow(M lanes, V& iterations, const Restart& restart) {
    Elimination& e = n.e;
    M active = lanes, done{};
    e.counts = true;
    for (int k = 0; k < most_iterations && any(active); ++k) {
      n.put_load(factor, select(looking, factor + ahead, factor));
      e.count_anew();
      n.laws.evaluate(false);
      n.linearize();
      if (n.P.spring_count > 0) n.springs_too();
      V m[6][6];
      n.dense(n.K, m);
      invert(n.e, m);
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
      active &= ~(circulatory & (e.negative > 0.0));  // counted otherwise there (theory K4): the reference's

      // Newton's step, the first one of a way where the lane has looked.
      const M onward = active & looking & (proven | again), iterating = active & ~looking;
      const M near = norm < n.in.tolerance;
      M found = iterating & near & ((factor < 1.0) | (norm < n.small) | (previous < n.in.tolerance));
      const M short_enough = finite & (norm <= largest_step) & (tries < most_tries);
      // As fast as steps that all shrink enough: one that does not may follow one that shrank a hundredfold.
      allowed *= contraction;
      const M shrinks = (norm <= contraction * previous) | (norm <= allowed) | (norm <= 1e-7);
      M sound = (onward & short_enough) | found | (iterating & ~fresh & short_enough & shrinks) |
                (iterating & fresh & finite & (tries < most_tries));
      // Where stability changed on a way that is too long to look closely, the change is enclosed. That only says where
      // to look, so that an equilibrium need not be exact, as long as such hints come true.
      const M other = iterating & ~fresh & (e.negative != stable);
      const M far =
          other & ~by_halves & (found | (hints & (norm < hint * first_step))) & (factor - reached > crossing_step);
      if (any(far)) enclose(far);
      found &= ~far;
      sound &= ~far;
      n.move(sound);
      const M back = active & ~sound & ~fresh;
      active &= ~(~sound & fresh);  // not even an unloaded equilibrium
      const M starts = onward & sound;
      factor = select(starts, select(ahead < 1.0 - factor, factor + ahead, splat(1)), factor);
      previous = norm;
      first_step = select(starts, norm, first_step);
      allowed = select(starts, norm, allowed);
      tries = select(iterating & ~found, tries + 1.0, splat(1));
      looking = (looking & ~starts) | found;
      again &= ~starts;
      if (any(found)) {
        const V step = factor - reached, left = 1.0 - factor, twice = step + step;
        const V next = select(left > 0.0, select(twice < left, twice, left), step);
        ahead = select(found, select(fresh, splat(0.5), next), ahead);
        // Beyond the change the way goes on in the strides of before.
        const M crossed = found & enclosed & (other | (factor >= change));
        ahead = select(crossed & (left > 0.0), select(stride < left, stride, left), ahead);
        enclosed &= ~crossed;
        hints &= ~(crossed & ~other);  // there was none
        const M before = found & ~fresh & ~other;
        if (any(before)) note(before, factor, 1);
        if (any(found & enclosed)) {
          aim(found & enclosed, factor);
          ahead = select(found & (twice < ahead) & ~crossed & ~fresh, twice, ahead);
        }
      }
      if (any(back)) {
        const V failed = select(onward, ahead, factor - reached);
        restore(back);
        ahead = select(back, 0.5 * failed, ahead);
        if (any(far)) aim(far, reached);
        factor = select(back, reached, factor);
        looking |= back;
        again |= back;
        ended |= back & ((ahead < shortest) | (steps > most_steps) | (aims > most_aims));
        // The reference only halves: what it passes next to a sharp turn may end here and the other way round.
        const M anew = ended & active & aimed;
        if (any(anew)) {
          restart(anew);
          begin_by_halves(anew);
        }
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
  static constexpr double most_aims = 32;  // at one change: where they do not come true, halves do
  static constexpr double hint = 1.0 / 256;
  static constexpr double bend = 0.1, crossing_bend = 1e-3, bend_noise = 1e-9;

  M circulatory = n.circulatory_lanes();
  M looking = {}, again = {};  ///< at an equilibrium; it was looked at before
  M fresh = ~M{};              ///< before the unloaded equilibrium is known
  V factor = splat(0);         ///< share of the load, of the present iterate
  V reached = splat(0);        ///< share whose equilibrium is proven
  V ahead = splat(0);          ///< share on which a lane looks ahead
  V previous = splat(1), tries = splat(0), steps = splat(0);
  V allowed = splat(0);  ///< size of a step if all since the first one had shrunk just enough
  V stable = splat(0);   ///< falling directions at the proven equilibrium

  // A change of stability ahead, met on a way too long to be proven: between `reached` and `change`.
  M enclosed = {}, hints = ~M{}, aimed = {}, by_halves = {};
  V change = splat(2), changed_by = splat(1), stride = splat(0.5), aims = splat(0), first_step = splat(0);
  V old_place = splat(0), old_size = splat(0), old_side = splat(1);  ///< the last two places where pivots were counted:
  V new_place = splat(0), new_size = splat(0), new_side = splat(1);  ///< log of their product, -1 beyond the change

  /// Logarithm (of 2) of the product of all pivots.
  V size() const {
    V out;
    for (int i = 0; i < W; ++i) out[i] = __builtin_log2(n.e.product[i]) + 332.19280948873623 * n.e.hundreds[i];
    return out;
  }

  void note(M lanes, V place, double side) {
    old_place = select(lanes, new_place, old_place);
    old_size = select(lanes, new_size, old_size);
    old_side = select(lanes, new_side, old_side);
    new_place = select(lanes, place, new_place);
    new_size = select(lanes, size(), new_size);
    new_side = select(lanes, splat(side), new_side);
  }

  void enclose(M lanes) {
    stride = select(lanes & ~enclosed, factor - reached, stride);
    aims = select(lanes & ~enclosed, splat(0), aims);
    note(lanes, factor, -1);
    change = select(lanes, factor, change);
    changed_by = select(lanes, absolute(n.e.negative - stable), changed_by);
    enclosed |= lanes;
    aimed |= lanes;
  }

  void begin_by_halves(M lanes) {
    by_halves |= lanes;
    fresh |= lanes;
    for (M* flag : {&ended, &aimed, &enclosed, &looking, &again}) *flag &= ~lanes;
    for (V* number : {&factor, &reached, &ahead, &tries, &steps, &stable, &aims})
      *number = select(lanes, splat(0), *number);
    previous = select(lanes, splat(1), previous);
  }

  /// The next way from `from`: up to shortly before the change, which is where the pivots that change sign vanish, by
  /// a secant of their product; every fourth time half of the way; across where that is short enough to look closely.
  void aim(M lanes, V from) {
    const V width = change - from;
    V share = splat(0.5);
    for (int i = 0; i < W; ++i) {
      if (!lanes[i] || static_cast<int>(aims[i]) % 4 == 3) continue;
      const double was = old_side[i] * __builtin_exp2((old_size[i] - new_size[i]) / changed_by[i]);
      const double place = new_place[i] - new_side[i] * (new_place[i] - old_place[i]) / (new_side[i] - was);
      const double found = (place - from[i]) / width[i];
      if (found >= 0 && found <= 1) share[i] = found;
    }
    const V before = share * width - 0.5 * crossing_step;
    V goal = select(before > 0.5 * crossing_step, before, splat(0.999 * crossing_step));
    goal = select(width <= crossing_step, larger(width, splat(0.25 * crossing_step)), goal);
    ahead = select(lanes, select(goal < 1.0 - from, goal, 1.0 - from), ahead);
    aims = select(lanes, aims + 1.0, aims);
  }

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
    const V bound = select(crossed, splat(crossing_bend), splat(bend));
    return (apart <= bend_noise * P.length + bound * chord) & ~(crossed & (step > crossing_step));
  }

  /// The equilibrium before the last step is where these lanes go back to.
  void accept(M lanes) {
    Scratch& s = n.s;
    const V slope = 1.0 / ahead;
    for (int q = 0; q < n.P.coordinate_count; ++q) {
      s.kept[q] = select(lanes, s.z[q], s.kept[q]);
      s.slope[q] = select(lanes, slope * s.dz[q], s.slope[q]);
    }
    each_shared_wrench(n.P, n.s, [&](BranchSlot& b) { b.kept = select(lanes, b.before, b.kept); });
    reached = select(lanes, factor, reached);
    stable = select(lanes, n.e.negative, stable);
    steps = select(lanes, steps + 1.0, steps);
  }

  void restore(M lanes) {
    Scratch& s = n.s;
    for (int q = 0; q < n.P.coordinate_count; ++q) s.z[q] = select(lanes, s.kept[q], s.z[q]);
    each_shared_wrench(n.P, n.s, [&](BranchSlot& b) { b.F = select(lanes, b.kept, b.F); });
  }
};

}  // namespace stiffmap::kernel
