// SPDX-License-Identifier: MIT
// The load path of the reference (theory E9) in lanes, for what Newton's first steps do not settle: from the unloaded
// equilibrium in steps that are each proven, a change of stability looked at closely. Each lane is at its own place of
// the path. A lane either iterates at its share of the load, or it looks from an equilibrium where the path goes on:
// with the load ahead in the residual its step is the path's slope times the way, and if the way here is proven, it is
// the first step of the way there, bent as the way here was (docs/fast_path.md F22).
#pragma once

#include "newton.hpp"

namespace stiffmap::kernel {

struct LoadPath {
  Newton& n;
  M unstable = {};    ///< of the lanes that arrived: the energy falls in some direction
  M ended = {};       ///< lanes whose path of equilibria ends before the whole load
  M unfinished = {};  ///< lanes that are still on their way after `most` linearisations

  static constexpr int most_iterations = 4000, most_of_most = 96;

  explicit LoadPath(Newton& newton) : n(newton) {}

  /// Follows the path of `lanes`, which stand at their start, for at most `most` linearisations; returns those that
  /// arrive at the whole load. `restart` puts lanes back to their start.
  template <class Restart>
  M follow(M lanes, int most, V& iterations, const Restart& restart) {
    Elimination& e = n.e;
    M active = lanes, done{};
    e.counts = true;
    for (int k = 0; k < most && any(active); ++k) {
      n.put_load(factor, select(looking, factor + ahead, factor));
      e.count_anew();
      n.laws.evaluate(false);
      n.linearize();
      if (n.P.spring_count > 0) n.springs_too();
      V m[6][6];
      n.dense(n.K, m);
      invert(n.e, m);
      n.step(m, active);
      V norm = n.step_norm();
      iterations = select(active, iterations + 1.0, iterations);
      const M finite = norm < 1e6;

      // Equilibria: is the way here proven?
      const M judged = active & looking, first = judged & fresh & finite;
      const M proven = first | (judged & ~fresh & finite & way_proven());
      M arrived = proven & (factor == 1.0) & ~fresh;
      if (any(first)) arrived |= first & n.unloaded_lanes();
      const V came = factor - reached;
      if (any(proven)) accept(proven, proven & ~fresh);
      if (any(arrived)) {
        keep_wrenches(e, arrived);
        n.take(arrived, m);
        done |= arrived & (e.closest > n.pivot_floor);
      }
      fresh &= ~first;
      active &= ~arrived;
      active &= ~(circulatory & (e.negative > 0.0));  // counted otherwise there (theory K4): the reference's

      // Newton's step, the first one of a way where the lane has looked.
      const M onward = active & looking & proven, iterating = active & ~looking;
      const M plain = ~(enclosed | by_halves);
      if (any(onward & plain)) norm *= go(onward & plain, first, came, norm);
      const M near = norm < n.in.tolerance;
      M found = iterating & near & ((factor < 1.0) | (norm < n.small) | (previous < n.in.tolerance));
      // On the way an equilibrium need not be exact: what its last step leaves is of that step's square.
      const M on_the_way = iterating & ~fresh & plain & (factor < 1.0) & (e.negative == stable);
      found |= on_the_way & (norm * norm < rough * previous) & (norm <= rough_share * previous);
      const M short_enough =
          finite & (norm <= select(onward & plain, longest_way, largest_step)) & (tries < most_tries);
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
      if (any(starts & plain)) bend_on(starts & plain);
      drift = select(iterating & (tries == 1.0), norm / first_step, drift);
      factor = select(starts, select(ahead < 1.0 - factor, factor + ahead, splat(1)), factor);
      previous = norm;
      first_step = select(starts, norm, first_step);
      allowed = select(starts, norm, allowed);
      tries = select(iterating & ~found, tries + 1.0, splat(1));
      looking = (looking & ~starts) | found;
      if (any(found)) {
        const V step = factor - reached, left = 1.0 - factor, twice = step + step;
        const V longest = select(plain, twice + twice, twice);
        const V next = select(left > 0.0, select(longest < left, longest, left), step);
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
          ahead = select(found & enclosed & (twice < ahead) & ~fresh, twice, ahead);
        }
      }
      if (any(back)) {
        const V failed = select(onward, ahead, factor - reached);
        const V half = 0.5 * failed, by_drift = failed * larger(splat(0.02), easy_drift / drift);
        const V goal = larger(by_drift, select(half < shortest, half, splat(shortest)));
        ahead = select(back, select(plain & (goal < half), goal, half), ahead);
        drift = select(back, splat(0), drift);
        if (any(far)) aim(far, reached);
        leap(back);
        looking &= ~back;
        tries = select(back, splat(1), tries);
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
    unfinished = active;
    e.counts = false;
    unstable = done & (stable > 0.0);
    return done;
  }

 private:
  static constexpr double contraction = 0.2, most_tries = 40;
  static constexpr double shortest = 1.0 / 16384, crossing_step = 1.0 / 1024, most_steps = 400;
  static constexpr double most_aims = 32;  // at one change: where they do not come true, halves do
  static constexpr double hint = 1.0 / 256;
  static constexpr double bend = 0.1, crossing_bend = 1e-3, bend_noise = 1e-9;

  M circulatory = n.circulatory_lanes();
  static constexpr double rough = 1e-5, rough_share = 0.05;  ///< what the last step of an equilibrium on the way leaves
  static constexpr double easy_drift = 0.05, easy_bend = 0.06;  ///< what the strides aim at
  const V longest_way = splat(0.4), largest_step = splat(0.2);

  M looking = {};        ///< at an equilibrium
  M fresh = ~M{};        ///< before the unloaded equilibrium is known
  V factor = splat(0);   ///< share of the load, of the present iterate
  V reached = splat(0);  ///< share whose equilibrium is proven
  V ahead = splat(0);    ///< share on which a lane looks ahead
  V previous = splat(1), tries = splat(0), steps = splat(0);
  V allowed = splat(0);  ///< size of a step if all since the first one had shrunk just enough
  V stable = splat(0);   ///< falling directions at the proven equilibrium
  V knee = splat(1);     ///< share of the first way: where it counts by its logarithm instead of itself
  V drift = splat(0);    ///< the second step of a way, of the first
  V bent = splat(0);     ///< of the last proven way: its chord against the tangents

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
    for (M* flag : {&ended, &aimed, &enclosed, &looking}) *flag &= ~lanes;
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
  M way_proven() {
    const Program& P = n.P;
    const Scratch& s = n.s;
    V chord = splat(0), apart = splat(0);
    const V step = factor - reached, forward = 0.5 * step / ahead, backward = 0.5 * step;
    for (int q = 0; q < P.coordinate_count; ++q) {
      const V way = s.z[q] - s.kept[q];
      chord = larger(chord, absolute(way) * P.coordinates[q].unit);
      apart = larger(apart, absolute(way - forward * s.dz[q] - backward * s.slope[q]) * P.coordinates[q].unit);
    }
    bent = apart / larger(chord, splat(1e-300));
    const M crossed = n.e.negative != stable;
    const V bound = select(crossed, splat(crossing_bend), splat(bend));
    return (apart <= bend_noise * P.length + bound * chord) & ~(crossed & (step > crossing_step));
  }

  /// The equilibrium before the last step is where these lanes go back to; `later`: of which the one before is known,
  /// so that the cubic through both and their slopes says how the path goes on.
  void accept(M lanes, M later) {
    Scratch& s = n.s;
    knee = select(later & (reached == 0.0), factor, knee);
    const V per = 1.0 / ahead, then = knee + reached, now = knee + factor;
    const V over = 1.0 / select(later, logarithm(now / then), splat(1));
    const auto series = [&](V from, V to, V before, V slope, V& second, V& third) {
      const V chord = over * (to - from), m = then * before, p = now * slope;
      second = select(lanes, select(later, over * (m + p + p - 3.0 * chord), splat(0)), second);
      third = select(lanes, select(later, over * over * (m + p - 2.0 * chord), splat(0)), third);
    };
    for (int q = 0; q < n.P.coordinate_count; ++q) {
      const V slope = per * s.dz[q];
      series(s.kept[q], s.z[q], s.slope[q], slope, s.second[q], s.third[q]);
      s.kept[q] = select(lanes, s.z[q], s.kept[q]);
      s.slope[q] = select(lanes, slope, s.slope[q]);
    }
    each_shared_wrench(n.P, n.s, [&](BranchSlot& b) {
      for (int i = 0; i < 6; ++i) {
        const V at = part(b.before, i), slope = per * (part(b.F, i) - at);
        series(part(b.kept, i), at, part(b.slope, i), slope, part(b.second, i), part(b.third, i));
        part(b.kept, i) = select(lanes, at, part(b.kept, i));
        part(b.slope, i) = select(lanes, slope, part(b.slope, i));
      }
    });
    reached = select(lanes, factor, reached);
    stable = select(lanes, n.e.negative, stable);
    steps = select(lanes, steps + 1.0, steps);
  }

  static V logarithm(V x) {
    V out{};
    for (int i = 0; i < W; ++i) out[i] = __builtin_log(x[i]);
    return out;
  }
  static V exponential(V x) {
    V out{};
    for (int i = 0; i < W; ++i) out[i] = __builtin_exp(x[i]);
    return out;
  }

  static V& part(V6& w, int i) {
    V* const parts[] = {&w.a.x, &w.a.y, &w.a.z, &w.b.x, &w.b.y, &w.b.z};
    return *parts[i];
  }

  /// How much of the way ahead lanes go that have come as far as `came`, so that the next way bends as much as it may;
  /// their step is shortened to it.
  V go(M lanes, M first, V came, V norm) {
    const V by_bend = root(easy_bend / larger(bent, splat(1e-6))),
            square = root(easy_drift / larger(drift, splat(1e-6)));
    const V by_drift = select(square < 1.0, square, root(square)), now = knee + factor, before = now - came;
    const V more = select(by_bend < by_drift, by_bend, by_drift) * logarithm(now / before);
    const V wish = select(first, ahead, now * exponential(more) - now);
    const V within = ahead * (0.9 * longest_way) / norm, least = select(wish < within, wish, within);
    const V share = select(lanes & (least < ahead), least / ahead, splat(1));
    ahead *= share;
    n.shorten(share);
    return share;
  }

  /// Bends the step that these lanes have just made as the series of the path says.
  void bend_on(M lanes) {
    const M later = lanes & (reached > 0.0);
    const V now = knee + reached, t = logarithm((now + ahead) / now);
    const V more = now * t - ahead, square = t * t, cube = t * square;
    const auto bent_on = [&](V at, V slope, V second, V third) {
      return select(later, at + (more * slope + square * second + cube * third), at);
    };
    for (int q = 0; q < n.P.coordinate_count; ++q)
      n.s.z[q] = bent_on(n.s.z[q], n.s.slope[q], n.s.second[q], n.s.third[q]);
    each_shared_wrench(n.P, n.s, [&](BranchSlot& b) {
      for (int i = 0; i < 6; ++i)
        part(b.F, i) = bent_on(part(b.F, i), part(b.slope, i), part(b.second, i), part(b.third, i));
    });
  }

  /// From the equilibrium of before again, by another way ahead.
  void leap(M lanes) {
    Scratch& s = n.s;
    V longest = splat(0);
    for (int q = 0; q < n.P.coordinate_count; ++q)
      longest = larger(longest, absolute(s.slope[q]) * n.P.coordinates[q].unit);
    longest *= 1 / n.P.length;
    for (int k = 0; k < 10; ++k) ahead = select(lanes & (ahead * longest > largest_step), 0.5 * ahead, ahead);
    for (int q = 0; q < n.P.coordinate_count; ++q) s.z[q] = select(lanes, s.kept[q] + ahead * s.slope[q], s.z[q]);
    each_shared_wrench(n.P, n.s, [&](BranchSlot& b) { b.F = select(lanes, b.kept + ahead * b.slope, b.F); });
    const M bends = lanes & ~(enclosed | by_halves);
    if (any(bends)) bend_on(bends);
    factor = select(lanes, reached + ahead, factor);
    previous = select(lanes, ahead * longest, previous);
    first_step = select(lanes, previous, first_step);
    allowed = select(lanes, previous, allowed);
  }
};

}  // namespace stiffmap::kernel
