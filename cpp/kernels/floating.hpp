// SPDX-License-Identifier: MIT
// A platform that hangs in cables alone, in lanes: its closure, and the way downhill to the lowest energy
// (docs/fast_path.md F21, theory B5).
#pragma once

#include "newton.hpp"

namespace stiffmap::kernel {

struct Floating {
  const Program& P;
  const KernelInput& in;
  Scratch& s;
  Newton& newton;
  M found{}, far{};

  static constexpr int most_steps = 60, most_damped = 14;
  static constexpr double longest_step = 0.1, far_away = 0.2;  ///< of the length
  static constexpr double arrived = 1e-13, close_by = 1e-9;
  static constexpr double sufficient = 1e-4, energy_noise = 1e-14;

  /// Where the platform stands, and what acts on it there.
  struct State {
    Frame tip;
    V3 point;
    V6 gradient;
    Sym6 K;
    V energy, noise;
  };

  /// Joint coordinates of the free platform at a frame of its body: along the base axes, then Rx Ry Rz.
  static void coordinates(const Program& P, const V3& p, const M3& R, const V* near, Scratch& s) {
    const std::int32_t* q = P.free;
    const V3 x = p - lanes_of(P.guide);
    s.x[q[0]] = x.x;
    s.x[q[1]] = x.y;
    s.x[q[2]] = x.z;
    const M turned = (R.c[2].x != 0.0) | (R.c[2].y != 0.0) | (R.c[1].x != 0.0) | (R.c[0].x < 0.0) | (R.c[2].z < 0.0);
    if (!any(turned)) {
      for (int k = 3; k < 6; ++k) s.x[q[k]] = splat(0);
      return;
    }
    const V sine = R.c[2].x, cosine = root(larger(1.0 - sine * sine, splat(0)));
    const V angle[3] = {angle_of(R.c[2].z, -R.c[2].y), angle_of(cosine, sine), angle_of(R.c[0].x, -R.c[1].x)};
    for (int k = 0; k < 3; ++k) {
      V a = angle[k];
      if (near)
        for (int i = 0; i < W; ++i)
          a[i] += 6.283185307179586 * __builtin_round((near[k][i] - a[i]) / 6.283185307179586);
      s.x[q[3 + k]] = a;
    }
  }

  /// Closed coordinates of the command, winches included.
  static void close(const Program& P, const Frame& command, Scratch& s) {
    const V3 home[3] = {lanes_of(P.home_R), lanes_of(P.home_R + 3), lanes_of(P.home_R + 6)};
    // R_command = Rxyz R_home
    M3 R;
    V3 rows[3];
    for (int k = 0; k < 3; ++k) rows[k] = {P.home_R[k] + V{}, P.home_R[3 + k] + V{}, P.home_R[6 + k] + V{}};
    for (int k = 0; k < 3; ++k) R.c[k] = command.R * rows[k];
    bool same = true;
    for (int k = 0; k < 3; ++k) {
      const V3 d = command.R.c[k] - home[k];
      same = same && all((d.x == 0.0) & (d.y == 0.0) & (d.z == 0.0));
    }
    if (same)
      for (int k = 0; k < 3; ++k) R.c[k] = {splat(k == 0), splat(k == 1), splat(k == 2)};
    coordinates(P, command.p - R * lanes_of(P.tip_from_body), R, nullptr, s);
    wind(P, command, s);
  }

  [[gnu::noinline]] void evaluate(State& at) const {
    V6 wrench = newton.dead_load;
    at.K = Sym6{};
    at.energy = splat(0);
    pull_at_tip(P, s, at.tip, at.point, wrench, &at.K, &at.energy);
    at.noise = at.energy;
    if (P.weight > 0) {
      const V3 c = at.tip.p + at.tip.R * lanes_of(P.weight_at), r = c - at.point,
               g = splat(P.weight) * newton.whole_gravity;
      wrench = wrench + V6{g, cross(r, g)};
      at.energy -= dot(g, c);
      at.noise += root(dot(g, g)) * P.length;
      kernel::add_lever(at.K.E, splat(-1), g, r);
    }
    at.gradient = splat(-1) * wrench;
  }

  V6 load_at(const M3& R) const {
    return newton.turning.turns() ? newton.turning.at(newton.whole_load, R) : newton.whole_load;
  }

  static M3 chosen(M m, const M3& a, const M3& b) {
    return {{select(m, a.c[0], b.c[0]), select(m, a.c[1], b.c[1]), select(m, a.c[2], b.c[2])}};
  }

  /// Lanes that stand in a minimum of the energy.
  M run(M usable, V& iterations) {
    Elimination& e = newton.e;
    newton.laws.evaluate(false);
    newton.put_load(splat(1), splat(1));
    newton.frames();
    const Frame start = newton.tip;
    const V3 arm = lanes_of(P.places[in.point].actual.p);
    State now{start, newton.point, {}, {}, {}, {}};
    V6 load = newton.dead_load = load_at(now.tip.R);
    evaluate(now);
    V share = splat(1), previous = splat(1e300);
    M done = ~usable & usable, failed = ~usable;
    V6 before_load = load;
    for (int k = 0; k < most_steps; ++k) {
      const M active = ~done & ~failed;
      if (!any(active)) break;
      iterations = select(active, iterations + 1.0, iterations);
      V m[6][6], inverse[6], lowest, damping = splat(0);
      for (int t = 0; t < most_damped; ++t) {
        unpack(now.K, m);
        for (int i = 0; i < 6; ++i) m[i][i] += damping * (e.scale[i] * e.scale[i]);
        lowest = splat(1e300);
        ldlt(m, inverse, lowest, e.scale);
        const M soft = active & ~(lowest > 1e-9);
        if (!any(soft)) break;
        damping = select(soft, select(damping > 0.0, 8.0 * damping, splat(1e-6)), damping);
      }
      V x[6], g[6];
      put(now.gradient, g);
      for (int i = 0; i < 6; ++i) x[i] = -g[i];
      ldlt_solve(m, inverse, x);
      const V6 whole = get(x);
      V norm = dot(whole.a, whole.a) + (P.length * P.length) * dot(whole.b, whole.b), slope = splat(0);
      for (int i = 0; i < 6; ++i) slope += g[i] * x[i];
      norm = root(norm) * (1 / P.length);
      failed |= active & ~(norm < 1e6);
      const V cut = share * select(norm > longest_step, longest_step / norm, splat(1));
      const M sound = damping == 0.0;
      // The tangent here is the answer's where the step is next to nothing; that step is taken all the same.
      const M settled =
          active & sound & ((norm < arrived) | ((norm < close_by) & (previous < close_by) & (share == 1.0)));
      if (any(settled)) {
        newton.tip = now.tip;  // a load that turns is turned as it is here
        newton.dead_load = before_load;
        newton.K = now.K;
        V full[6][6];
        newton.dense(now.K, full);
        e.lowest = splat(1e300);
        invert(e, full);
        const M good = settled & (e.lowest > newton.pivot_floor);
        failed |= settled & ~good;
        newton.answer.take(good, now.K, full);
      }
      for (int i = 0; i < 6; ++i) x[i] *= cut;
      const V6 twist = get(x);
      State next{now.tip, now.point + twist.a, {}, {}, {}, {}};
      next.tip.R = turned_by(now.tip.R, twist.b);
      next.tip.p = next.point - next.tip.R * arm;
      newton.dead_load = load_at(next.tip.R);
      evaluate(next);
      const V promise = -slope * cut;
      const M whisper = promise < energy_noise * now.noise;
      const V work = dot(before_load.a, twist.a) + dot(before_load.b, twist.b);
      const M taken = active & (whisper | (next.energy - work <= now.energy - sufficient * promise));
      now.tip.p = select(taken, next.tip.p, now.tip.p);
      now.tip.R = chosen(taken, next.tip.R, now.tip.R);
      now.point = select(taken, next.point, now.point);
      now.gradient = select(taken, next.gradient, now.gradient);
      now.K = select(taken, next.K, now.K);
      now.energy = select(taken, next.energy, now.energy);
      now.noise = select(taken, next.noise, now.noise);
      before_load = select(taken, newton.dead_load, before_load);
      share = select(taken, splat(1), 0.25 * share);
      failed |= active & (share < 1e-12);
      previous = select(taken, norm, previous);
      done |= settled & ~failed;
    }
    const V3 away = now.tip.p - start.p;
    V chord = splat(0);
    for (int i = 0; i < 3; ++i) {
      const V3 turn = now.tip.R.c[i] - start.R.c[i];
      chord += dot(turn, turn);
    }
    far = dot(away, away) * (1 / (P.length * P.length)) + 0.5 * chord > far_away * far_away;
    newton.tip = now.tip;
    newton.point = now.point;
    newton.dead_load = load_at(now.tip.R);
    V6 last = newton.dead_load;
    pull_at_tip(P, s, now.tip, now.point, last, nullptr);  // what the winches hold at the answer
    answer_coordinates(start, now.tip);
    return done & ~failed;
  }

  /// Of the free joints, from how the tip has moved since the command.
  void answer_coordinates(const Frame& start, const Frame& now) {
    const std::int32_t* q = P.free;
    const V3 body = lanes_of(P.guide) + V3{s.x[q[0]], s.x[q[1]], s.x[q[2]]};
    const V3 d = start.R % (body - start.p);
    V sn, cs;
    M3 R{{{splat(1), splat(0), splat(0)}, {splat(0), splat(1), splat(0)}, {splat(0), splat(0), splat(1)}}};
    V near[3];
    for (int k = 0; k < 3; ++k) {
      near[k] = s.x[q[3 + k]];
      sincos(near[k], sn, cs);
      const V3 a = R.c[(k + 1) % 3], b = R.c[(k + 2) % 3];
      R.c[(k + 1) % 3] = cs * a + sn * b;
      R.c[(k + 2) % 3] = cs * b - sn * a;
    }
    M3 turned;  // now.R start.R' R
    for (int k = 0; k < 3; ++k) turned.c[k] = now.R * (start.R % R.c[k]);
    coordinates(P, now.p + now.R * d, turned, near, s);
  }
};

}  // namespace stiffmap::kernel
