// SPDX-License-Identifier: MIT
// What the reference tries where the path of equilibria ends (theory E9): Newton's whole steps at eighths of the load,
// shortened where the merit doubles, until it converges or wanders. Step by step the reference's own iteration, its
// unknowns included, so that both wander alike: each lane at its own step.
#pragma once

#include "merit.hpp"
#include "newton.hpp"

namespace stiffmap::kernel {

struct LastAttempt {
  Newton& n;
  M found = {};     ///< lanes with an equilibrium under the whole load
  M nowhere = {};   ///< lanes that wander
  M unstable = {};  ///< found, but the energy falls in some direction

  explicit LastAttempt(Newton& newton) : n(newton) {}

  /// Whether the kernels' unknowns are the reference's, its laws smooth and its forces those at the tip alone.
  static bool possible(const Newton& n) {
    const Program& P = n.P;
    return !n.turning.turns() && !P.starts_linear && !P.hardens && P.spring_count == 0 && P.group_slots == 0 &&
           !n.e.heavy;
  }

  /// From the unloaded configuration of `lanes`, which stand there.
  void run(M lanes, V& iterations) {
    Elimination& e = n.e;
    e.counts = e.exact = e.heavy = true;
    M active = lanes & ~n.circulatory_lanes();
    for (int pass = 0; pass < most_passes && any(active); ++pass) {
      n.put_load(factor, factor);
      e.count_anew();
      n.laws.evaluate(false);
      n.linearize();
      const V now = merit(e);
      const M accepted = active & judge(active, now);
      V m[6][6];
      n.dense(n.K, m);
      invert(n.e, m);
      active &= ~(accepted & ~(e.closest > regular));  // next to a singular tangent: the reference's
      const M steps = active & accepted;
      keep(steps);
      n.step(m, steps);
      const V norm = n.step_norm();
      active &= ~(steps & ~(norm < 1e6));
      iterations = select(steps & active, iterations + 1.0, iterations);
      const M arrived = steps & active & (norm < n.in.tolerance) & (factor == 1.0);
      const M settled = arrived & ((norm < n.small) | again), going = steps & active & ~settled;
      again = arrived & ~settled;
      if (any(settled)) answer(settled, m);
      active &= ~settled;
      count(going & ~(norm < n.in.tolerance), now);
      nowhere |= active & (idle > most_idle) & (now > in_balance());
      active &= ~nowhere & ~(going & (tries >= most_tries));
      n.move(going & active);
      start_next(going & active & (norm < n.in.tolerance));
    }
    e.counts = e.exact = e.heavy = false;
  }

 private:
  static constexpr int most_passes = 2000;
  static constexpr double most_idle = 10, most_tries = 40;  // as the reference's
  static constexpr double shortest = 1.0 / 128, balanced = 1e-9;
  const double regular = 1e-6 * n.P.softest;

  M again = {};  ///< lanes whose last step under the whole load was below the tolerance
  V factor = splat(1.0 / 8);
  V tries = splat(0), idle = splat(0);  ///< Newton steps at this factor, those since the merit was halved last
  V least = splat(1e300), before = splat(1e300);  ///< merit, squared: the least at this factor, and before the step
  V share = splat(1);                             ///< of the last step that was taken

  double in_balance() const { return balanced * balanced * n.P.stiffness * n.P.length * n.P.length; }

  /// Lanes whose last step is accepted; the others go back by half of it. Squares: merit may double, must fall by a
  /// tenth of the share in a shortened step.
  M judge(M active, V now) {
    const M checked = tries > 3.0;
    const V fall = 1.0 - 0.1 * share;
    const M good = select(share == 1.0, splat(4), fall * fall) * before > now;
    const M accepted = ~checked | good | (share <= shortest);
    const M back = active & ~accepted;
    if (any(back)) {
      share = select(back, 0.5 * share, share);
      for (int q = 0; q < n.P.coordinate_count; ++q)
        n.s.z[q] = select(back, n.s.kept[q] + 0.5 * (n.s.z[q] - n.s.kept[q]), n.s.z[q]);
      each_shared_wrench(n.P, n.s,
                         [&](BranchSlot& b) { b.F = select(back, b.kept + splat(0.5) * (b.F - b.kept), b.F); });
    }
    return accepted;
  }

  void keep(M lanes) {
    for (int q = 0; q < n.P.coordinate_count; ++q) n.s.kept[q] = select(lanes, n.s.z[q], n.s.kept[q]);
    each_shared_wrench(n.P, n.s, [&](BranchSlot& b) { b.kept = select(lanes, b.F, b.kept); });
  }

  void count(M lanes, V now) {
    const M falls = now < 0.25 * least;
    idle = select(lanes, select(falls, splat(0), idle + 1.0), idle);
    least = select(lanes & falls, now, least);
    before = select(lanes, now, before);
    tries = select(lanes, tries + 1.0, tries);
    share = select(lanes, splat(1), share);
  }

  void answer(M lanes, const V (&m)[6][6]) {
    keep_wrenches(n.e, lanes);
    n.take(lanes, m);
    const M sure = lanes & (n.e.closest > n.pivot_floor);
    found |= sure;
    unstable |= sure & (n.e.negative > 0.0);
  }

  /// The next eighth of the load; at the whole load steps go on until they are round-off.
  void start_next(M lanes) {
    factor = select(lanes & (factor < 1.0), factor + 1.0 / 8, factor);
    tries = select(lanes, splat(0), tries);
    idle = select(lanes, splat(0), idle);
    least = select(lanes, splat(1e300), least);
  }
};

}  // namespace stiffmap::kernel
