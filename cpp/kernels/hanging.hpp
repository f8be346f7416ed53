// SPDX-License-Identifier: MIT
// Rods whose centre of mass is off the line of their joints: from the equilibrium with their spins held to where they
// hang (theory C10, docs/fast_path.md F21). Newton with the spins as joints of their chains; by how much one turns at
// once is a pendulum's to say.
#pragma once

#include "let_go.hpp"

namespace stiffmap::kernel {

struct Hanging {
  Newton& n;     ///< of the program in which those spins are free
  Newton& held;  ///< of the one in which they are not
  const Program& P = n.P;
  Scratch& s = n.s;
  V least = splat(0);  ///< moment that the reference takes for round-off

  /// Lanes in which all spins that weights turn have come to rest, and no other is turned. `n` has the answer.
  [[gnu::noinline]] M settle(M lanes, V& iterations) {
    n.put_load(splat(1), splat(1));
    held.put_load(splat(1), splat(1));
    least = noise();
    for (int i = 0; i < P.spin_count; ++i) s.kept[first(i).coordinate] = s.z[first(i).coordinate];
    V weight[most_spins], held_pivots[most_spins];
    for (int i = 0; i < P.spin_count; ++i) {
      V angle;
      weight[i] = pendulum(i, angle);
      if (P.spins[i].heavy) turn(i, lanes, angle);
    }
    close(lanes, iterations);
    for (int i = 0; i < P.spin_count; ++i) held_pivots[i] = pivots(held.P, i);
    M active = lanes, done{};
    const bool alone = LetGo::possible(held.P);
    V previous = splat(1), turned = splat(1), before[6][6];
    for (auto& row : before)
      for (V& c : row) c = splat(0);
    for (int k = 0; k < most_iterations && any(active); ++k) {
      V m[6][6];
      step(n, m, active, iterations);
      V largest = splat(0), moment = splat(0), rest = splat(0);
      M far{};
      for (int i = 0; i < P.spin_count; ++i) {
        if (!P.spins[i].heavy) continue;
        const V step = absolute(s.dz[P.spins[i].held]);
        largest = larger(largest, step);
        moment = larger(moment, step * weight[i]);
        far |= ~(step < farthest) | uphill(i);
      }
      for (int q = 0; q < P.coordinate_count; ++q)
        if (!turns(q)) rest = larger(rest, absolute(s.dz[q]) * P.coordinates[q].unit);
      rest = larger(rest * (1 / P.length), n.e.transferred);
      far &= active;
      const M near = active & ~far;
      // Of a light rod round-off turns more than that: it rests where its moment is next to nothing.
      const M still = (largest < small_turn) | ((moment < least) & (largest > 0.1 * turned));
      // Round-off decides how far a rod turns by a load where it hardly resists: then no two compliances are the same.
      const V change = changed(m, before);
      M settled = near & still & (alone ? ~M{} : change < same) & (n.e.lowest > definite) &
                  ((rest < Newton::small) | ((rest < n.in.tolerance) & (previous < n.in.tolerance)));
      if (P.hardens && any(settled)) settled &= n.laws.hardening_change() < Newton::same_slope;
      if (any(settled)) n.take(settled, m);
      n.move(near);
      done |= settled;
      active &= ~settled & (far | (rest < largest_step));
      previous = select(near, rest, splat(1));
      turned = select(near, largest, splat(1));
      if (any(far)) swing_on(far, iterations);
    }
    done &= clear(alone, held_pivots);
    unwind();
    if (alone && any(done)) done &= answer(done, iterations);
    n.settle();
    return done;
  }

 private:
  static constexpr int most_iterations = 12;
  static constexpr double farthest = 0.05;     ///< rad; beyond that only the rod is turned, its joints close again
  static constexpr double small_turn = 1e-9;   ///< rad
  static constexpr double largest_step = 0.2;  ///< of the length
  static constexpr double definite = 1e-15;    ///< least pivot
  static constexpr double certain =
      1.2e3;                               ///< least stiffness of what turns for sure, of `least`; the reference's: 1e3
  static constexpr double near_by = 0.05;  ///< of the length: too near for a direction
  static constexpr double same = 3e-11;    ///< of a compliance, from one linearisation at rest to the next
  static constexpr double round_off = 1e-11;  ///< as Spins
  static constexpr double pi = 3.14159265358979323846;

  const Op& first(int i) const { return P.ops[P.spins[i].first]; }
  const Op& last(int i) const { return P.ops[P.spins[i].last]; }
  const JointSlot& slot(const Op& op) const { return s.joints[op.slot]; }

  bool turns(int q) const {
    for (int i = 0; i < P.spin_count; ++i)
      if (P.spins[i].heavy && (first(i).coordinate == q || last(i).coordinate == q)) return true;
    return false;
  }

  V noise() const {
    double mass = 0;
    for (int i = 0; i < P.op_count; ++i)
      if (P.ops[i].kind == OpKind::load) mass += P.ops[i].mass;
    const V6& w = n.whole_load;
    const V loads = (mass * root(dot(n.whole_gravity, n.whole_gravity)) + root(dot(w.a, w.a))) * P.length;
    return round_off * (loads + root(dot(w.b, w.b)));
  }

  /// Turns spin i of the lanes by `angle` of its first coordinate, the second one back.
  void turn(int i, M lanes, V angle) {
    const V step = select(lanes, angle, splat(0)), along = dot(slot(first(i)).w, slot(last(i)).w);
    s.z[first(i).coordinate] += step;
    s.z[last(i).coordinate] -= select(along > 0.0, step, -step);
  }

  /// Of a rigid rod: its bodies' weight across the line of its joints times their lever, and by how much the first
  /// coordinate turns until they are below it.
  V pendulum(int i, V& angle) const {
    const JointSlot &a = slot(first(i)), &b = slot(last(i));
    V3 lever{};
    for (int k = P.spins[i].first; k < P.spins[i].last; ++k) {
      const Op& op = P.ops[k];
      if (op.kind == OpKind::load) lever = lever + splat(op.mass) * (slot(op).o + slot(op).w - b.o);
    }
    const V3 line = b.o - a.o;
    const V apart = root(dot(line, line));
    const M known = apart > near_by * P.length;
    const V3 along = select(known, (1.0 / select(known, apart, splat(1))) * line, a.w);
    const V3 across = lever - dot(lever, along) * along, pull = n.whole_gravity - dot(n.whole_gravity, along) * along;
    const V cosine = dot(across, pull), sine = dot(along, cross(across, pull));
    const V down = arc_tangent(sine, cosine);
    angle = select(dot(a.w, along) > 0.0, down, -down);
    return root(cosine * cosine + sine * sine);
  }

  /// Lanes in which a step leads to the top: with its ends held the rod has less than no stiffness, and of the pivots
  /// of its chain an odd number is negative.
  M uphill(int i) const { return pivots(P, i) < 0.0; }

  /// Product of the pivots of a spin's chain.
  V pivots(const Program& of, int i) const {
    V product = splat(1);
    const ChainProgram& chain = of.chains[of.spins[i].chain];
    for (int k = chain.first; k < chain.first + chain.count; ++k) {
      const Op& op = of.ops[k];
      if (op.kind <= OpKind::prismatic && op.eliminated) product *= slot(op).inverse;
      if (op.kind == OpKind::spring && k > chain.first_stiff)
        for (int q = 0; q < 6; ++q) product *= s.stiff[op.slot].inverse[q];
    }
    return 1.0 / product;
  }

  /// The linearisation with its step and inverse.
  [[gnu::noinline]] static void step(Newton& of, V (&m)[6][6], M lanes, V& iterations) {
    of.laws.evaluate(false);
    of.linearize();
    if (of.P.spring_count > 0) of.springs_too();
    of.dense(of.K, m);
    invert(of.e, m);
    of.step(m, lanes);
    iterations = select(lanes, iterations + 1.0, iterations);
  }

  /// A rod turned about an axis beside the line of its joints leaves gaps, which would turn it too.
  void close(M lanes, V& iterations) {
    V m[6][6];
    step(held, m, lanes, iterations);
    held.move(lanes);
  }

  /// What the held machine has there, less what the spins take.
  [[gnu::noinline]] M answer(M lanes, V& iterations) {
    V m[6][6];
    step(held, m, lanes, iterations);
    keep_wrenches(held.e, lanes);
    Sym6 K = held.K;
    M sound = ~M{};
    for (int i = 0; i < P.spin_count; ++i)
      if (P.spins[i].heavy) sound &= LetGo(held).soften(i, K) > certain * least;
    held.dense(K, m);
    held.e.lowest = splat(1e300);
    invert(held.e, m);
    sound &= held.e.lowest > held.pivot_floor;
    n.answer.take(lanes & sound, K, m);
    return sound;
  }

  /// Turns the rods alone, by as much as a pendulum needs that is t = tan(angle) from rest or from the top.
  [[gnu::noinline]] void swing_on(M lanes, V& iterations) {
    keep_wrenches(n.e, lanes);
    for (int i = 0; i < P.spin_count; ++i) {
      if (!P.spins[i].heavy) continue;
      const V t = s.dz[first(i).coordinate];
      const V angle = arc_tangent(t, splat(1));
      turn(i, lanes, select(uphill(i), select(t > 0.0, angle - pi, angle + pi), angle));
    }
    close(lanes, iterations);
  }

  /// Largest difference of two compliances, each entry by its diagonal's; the second becomes the first.
  [[gnu::noinline]] static V changed(const V (&now)[6][6], V (&before)[6][6]) {
    V size[6], worst = splat(0);
    for (int i = 0; i < 6; ++i) size[i] = 1.0 / root(absolute(now[i][i]));
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) {
        worst = larger(worst, absolute(now[i][j] - before[i][j]) * size[i] * size[j]);
        before[i][j] = now[i][j];
      }
    return worst;
  }

  /// Turned by at most half a turn, as downhill from where it was held.
  void unwind() {
    for (int i = 0; i < P.spin_count; ++i) {
      if (!P.spins[i].heavy) continue;
      const V way = s.z[first(i).coordinate] - s.kept[first(i).coordinate];
      turn(i, (way > pi) | (way < -pi), select(way > 0.0, splat(-2 * pi), splat(2 * pi)));
    }
  }

  /// Lanes in which the reference, too, takes the same spins for turned by weights: what their stiffness is at rest, of
  /// the others the moment.
  M clear(bool known, const V (&held_pivots)[most_spins]) const {
    M out = ~M{};
    for (int i = 0; i < P.spin_count; ++i) {
      if (P.spins[i].heavy) {
        if (!known) out &= pivots(P, i) > certain * least * held_pivots[i];
        continue;
      }
      const Op& its = first(i).coordinate == P.spins[i].held ? first(i) : last(i);
      out &= 2.0 * absolute(dot(slot(its).w, slot(its).F.b)) < least;
    }
    return out;
  }
};

}  // namespace stiffmap::kernel
