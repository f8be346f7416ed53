// SPDX-License-Identifier: MIT
// Equilibrium of a block of poses: Newton by the elimination, trust test per lane.
#pragma once

#include "corners.hpp"
#include "frames.hpp"
#include "laws.hpp"
#include "load_steps.hpp"
#include "platform.hpp"
#include "pulls.hpp"
#include "residual.hpp"
#include "serial.hpp"
#include "steps.hpp"
#include "tangents.hpp"
#include "tip_loads.hpp"
#include "wrenches.hpp"

namespace stiffmap::kernel {

struct Newton {
  /// As an aggregate it would be filled with zeros first: 26 kB for every block.
  Newton(const Program& program, const KernelInput& input, Scratch& scratch, Elimination& elimination, const V6& wrench,
         const V3& gravity)
      : P(program), in(input), s(scratch), e(elimination), whole_load(wrench), whole_gravity(gravity) {}

  const Program& P;
  const KernelInput& in;
  Scratch& s;
  Elimination& e;
  Laws laws{P, s};
  V6 whole_load;  ///< external wrench at the point, base axes, as at the command
  V3 whole_gravity;
  V6 load = whole_load;       ///< the share that acts, with the external springs
  V6 dead_load = whole_load;  ///< of the load alone, as it is turned now
  V6 pending = {};            ///< what is added in this step (F11)
  TipLoads turning;
  V acting = splat(1), ahead = splat(0);  ///< shares of the whole load in `dead_load` and `pending`
  Frame tip = {};                         ///< frame of the tip; the point is tip.p + tip.R point
  V3 point = {};
  Sym6 K = {};  ///< symmetric tangent at the point
  V6 c = {};
  V6 moved = {};  ///< twist of the point by the last step; not of an arm of joints alone
  Answer answer{};
  Serial serial{};     ///< of an arm of joints alone
  M stepped = {};      ///< lanes whose last step, next to nothing, moves what is answered and no more
  V6 stepped_by = {};  ///< the point in that step

  // ---- one linearisation ----------------------------------------------------------------------
  /// One copy of the code, as of `evaluate` and `linearize`: two could contract differently, and a
  /// pose's last bits would tell which of them ran.
  [[gnu::noinline]] void frames_and_wrenches() {
    frames();
    if (load_moves()) pull();
    transmit();
  }

  [[gnu::noinline]] void transmit() {
    V6 F = load;
    V3 at = point;
    wrenches(e, P.chains[P.root], F, at);
  }

  [[gnu::noinline]] void frames() {
    tip = {{splat(0), splat(0), splat(0)},
           {{{splat(1), splat(0), splat(0)}, {splat(0), splat(1), splat(0)}, {splat(0), splat(0), splat(1)}}}};
    walk<Build::actual>(P, P.chains[P.root], s.x, tip, s, e.only);
    point = tip.p;
    const double* o = P.places[in.point].actual.p;
    if (o[0] != 0 || o[1] != 0 || o[2] != 0) point = point + tip.R * V3{splat(o[0]), splat(o[1]), splat(o[2])};
  }

  /// Whether what acts on the tip depends on where it is.
  bool load_moves() const { return P.spring_count > 0 || turning.turns(); }

  /// The external springs act, and the load turns, where the tip is now. Apart from the other passes, so that machines
  /// without such springs keep their code and their bits.
  [[gnu::noinline]] void pull() {
    turn_load();
    load = dead_load;
    if (P.spring_count > 0) pull_at_tip(P, s, tip, point, load, nullptr);
  }
  void turn_load() {
    if (!turning.turns()) return;
    const V6 now = turning.at(whole_load, tip.R);
    load = dead_load = acting * now;
    pending = ahead * now;
  }
  [[gnu::noinline]] void springs_too() {
    V6 again{};
    pull_at_tip(P, s, tip, point, again, &K);
  }

  [[gnu::noinline]] void linearize() {
    frames_and_wrenches();
    e.lowest = splat(1e300);
    const Tangent t = tangent(e, P.chains[P.root], V3{}, load, point);
    K = t.K;
    c = t.c - pending;
  }

  /// Tangent of a small extra dead wrench at the point, K - S(m)/2 in the rotational block; the load turns.
  [[gnu::always_inline]] void dense(const Sym6& symmetric, V (&m)[6][6]) const {
    unpack(symmetric, m);
    const V3 h = splat(0.5) * dead_load.b;
    m[3][4] += h.z;
    m[3][5] -= h.y;
    m[4][3] -= h.z;
    m[4][5] += h.x;
    m[5][3] += h.y;
    m[5][4] -= h.x;
    if (turning.turns()) turning.soften(whole_load, acting, tip.R, m);
  }

  V step_norm() const {
    V worst = splat(0);
    for (int q = 0; q < P.coordinate_count; ++q) worst = larger(worst, absolute(s.dz[q]) * P.coordinates[q].unit);
    return worst * (1 / P.length);
  }

  /// Step of all coordinates from the last linearisation, m its inverse.
  void step(const V (&m)[6][6], M active) {
    V rhs[6], eta[6];
    put(c, rhs);
    for (int i = 0; i < 6; ++i) {
      eta[i] = splat(0);
      for (int j = 0; j < 6; ++j) eta[i] -= m[i][j] * rhs[j];
    }
    for (int q = 0; q < P.coordinate_count; ++q) s.dz[q] = splat(0);
    e.transferred = splat(0);
    moved = get(eta);
    back(e, P.chains[P.root], moved, point, V3{}, active);
  }

  /// One more step with the factors of the last linearisation, m its inverse, from where its own step led.
  [[gnu::noinline]] void chord_step(const V (&m)[6][6], M lanes) {
    laws.evaluate(false);
    frames_and_wrenches();
    c = residual(e, P.chains[P.root], point);
    step(m, lanes);
    move(lanes);
  }

  /// The same for an arm of joints alone, from frames alone.
  [[gnu::noinline]] void step_joints() {
    frames();
    turn_load();
    e.lowest = splat(1e300);
    for (int q = 0; q < P.coordinate_count; ++q) s.dz[q] = splat(0);  // also of joints that are held
    const Sym6* pulls = nullptr;
    if (P.spring_count > 0) pulls = &pull_arm();
    const bool more = turning.several();
    const TipLoads::Levers l = more ? turning.levers(whole_load, acting, tip.R) : TipLoads::Levers{{}, dead_load.b};
    const V3 pulled = load.b - dead_load.b;
    serial.step(e, {point, load, pending, l.moment, l.arms, pulled, pulls, whole_load, acting, turning, tip.R});
    e.transferred = splat(0);
  }

  /// The external springs' tangent at an arm's tip, their wrench in the load.
  [[gnu::noinline]] const Sym6& pull_arm() {
    load = dead_load;
    K = Sym6{};
    pull_at_tip(P, s, tip, point, load, &K);
    return K;
  }

  /// What an arm answers where its iteration settled.
  [[gnu::noinline]] void answer_joints(M after, V (&m)[6][6]) {
    serial.answer(e, point, after, m, K);
    if (turning.turns()) turning.symmetric(whole_load, acting, tip.R, K);
    if (any(serial.play.lanes)) serial.play.release(e, P.serial_joints, serial.twist, m, K);
  }

  void take(M lanes, const V (&m)[6][6]) { answer.take(lanes, K, m); }

  /// Iterates until every lane converged or is left to the reference path; lanes never wait for
  /// the answer of others, only for their time. A lane that is not trusted halves its own load step.
  M solve(M usable, bool corners, V& iterations, V& steps) {
    M done = ~usable & usable, failed = ~usable;
    LoadSteps way{P, s};
    const bool patient = in.patience >= Patience::path;
    const bool searches = corners && steps_by_deflections() && in.patience != Patience::path;
    const double most_tries = in.max_iterations * (!corners ? 1.0 : patient ? 3.0 : searches ? 1.0 : 0.5);
    way.begin(unloaded_lanes());
    for (int k = 0; k < most_iterations; ++k) {
      const bool secant = corners && k == 0;
      const M first = way.factor > way.acting;
      put_load(way.acting, way.factor);
      laws.evaluate(secant);
      V m[6][6];
      M active = ~done & ~failed;
      if (P.serial_joints >= 0) {
        serial.play.decides = corners && k == 1 && !turning.turns();
        step_joints();
      } else {
        linearize();
        if (P.spring_count > 0) springs_too();
        dense(K, m);
        invert(e, m);
        step(m, active);
      }
      const V norm = step_norm();
      iterations = select(active, iterations + 1.0, iterations);
      if (secant) {
        failed |= active & ~(norm < 1e6);
        move(active);
        failed |= laws.start(active) & active;
        way.acting = select(active, way.factor, way.acting);
        continue;
      }
      // Settled: this linearisation is the one at the answer. The step is taken all the same, unless
      // there is nothing to gain from it.
      const V change = larger(norm, e.transferred);
      const M whole = way.acting == 1.0;
      M last = change < small;
      // An arm's axes are answered where this step leads: of the tangent only the loads' share is left behind, with
      // that of springs outside too much.
      const V softest = e.lowest < 1.0 ? e.lowest : splat(1);
      M near = P.serial_joints >= 0 && P.spring_count == 0 ? ~last & (change < nearly * softest) : M{};
      last |= near;
      M settled = active & whole & (last | ((norm < in.tolerance) & (way.previous < in.tolerance)));
      if (P.hardens && any(settled)) {
        const V bent = laws.hardening_change();
        const M same = (bent < same_slope) | ((norm < small) & (way.previous < small));
        if (P.serial_joints >= 0) near |= ~same & (bent < near_slope);
        settled &= same | near;
      }
      if (P.serial_joints >= 0 && any(settled)) answer_joints(near, m);
      failed |= settled & ~(e.lowest > pivot_floor);
      const M resting = settled & last, kept = resting & (change < nothing);
      if (any(settled)) take(settled & ~failed, m);
      if (any(kept)) keep_wrenches(e, kept);
      if (any(resting & ~kept)) keep_step(resting & ~kept);
      M distrusted = active & ~settled & ~(norm < 1e6);
      if (!corners) {
        distrusted |= active & ~settled & ~(norm <= 0.2);
        // The second step makes up for what the first one left out (F11); as long as it is short and the
        // tangent definite, it may be as long as the first.
        const M second = (way.tries == 1.0) & (norm <= 5.0 * way.previous) & (norm <= 0.02) & (e.lowest > pivot_floor);
        distrusted |= active & ~settled & ~((norm <= 0.2 * way.previous) | (norm <= 1e-7) | second);
        // A tangent under the whole load must be definite.
        if (way.at_once) distrusted |= active & (way.tries == 0.0) & ~(e.lowest > pivot_floor);
      }
      // Corners make Newton's steps go to and fro: then each goes to the next corner, patiently.
      const M corner_steps = patient && !searches ? active & (way.tries > 1.0) : M{};
      if (corners && any(corner_steps)) shorten(select(corner_steps, laws.to_corner(), splat(1)));
      if (corners && !patient && !searches)
        distrusted |= active & ~settled & (way.tries > 2.0) & ~(norm <= 0.5 * way.previous);
      // Free play is the reference's to find: a singular step would leave the gap by chance.
      if (corners && k == 1) distrusted |= active & laws.open_gaps() & ~serial.play.lanes;
      if (P.serial_joints >= 0) distrusted |= active & serial.play.doubtful;
      distrusted |= active & ~settled & (way.tries >= most_tries);
      if (searches) {
        // Beyond that the tangent says little of the way: what tightens a cable is of second order.
        const V most = (patient ? 0.2 * longest : longest) / norm;
        const V searched = k > 1 ? Corners{P, s}.share() : splat(1);
        const V share = select(most < searched, most, searched);
        const M moving = active & ~resting & ~distrusted;
        if (any(moving & (share < 1.0))) shorten(select(moving, share, splat(1)));
        Corners{P, s}.move(moving, splat(1));
      } else {
        move(active & ~resting & ~distrusted);
      }
      done |= settled & ~failed;
      fresh = all(resting == active);
      way.previous = select(active, norm, way.previous);
      way.tries = select(active, way.tries + 1.0, way.tries);
      way.acting = select(active, way.factor, way.acting);
      const M arrived = active & ~whole & ~first & ~distrusted & (norm < in.tolerance);
      failed |= arrived & ~(e.lowest > pivot_floor);  // stability may change on the way: the reference looks closer
      if (any(arrived)) way.advance(arrived);
      // What this step leaves is of its square, and what one with the same factors leaves of that is next to nothing.
      if (P.parallel && !corners) {
        const M soon = (change < chord_most * softest) & (change < chord_longest);
        const M close = active & whole & ~settled & ~distrusted & soon & (norm > chord_least);
        if (any(close)) chord_step(m, close);
      }
      if (any(distrusted)) failed |= corners ? distrusted : way.halve(distrusted);
      if (all(done | failed)) break;
    }
    steps = way.halved;
    if (!fresh) {
      settle();
    } else {
      put_load(splat(1), splat(1));
      if (load_moves() && P.serial_joints >= 0) take_step();  // what pulls the tip does so where the step leads
      if (load_moves()) pull();
      if (P.serial_joints >= 0 || any(stepped)) transmit();
      if (!(load_moves() && P.serial_joints >= 0)) take_step();
    }
    return done & ~failed;
  }

  /// A step that changes the tangent by nothing is taken to first order: its square is below round-off.
  [[gnu::noinline]] void keep_step(M lanes) {
    const bool none = !any(stepped);
    for (int q = 0; q < P.coordinate_count; ++q) s.rest[q] = select(lanes, s.dz[q], none ? splat(0) : s.rest[q]);
    V6 twist = moved;
    if (P.serial_joints >= 0) {
      twist = V6{};
      for (int k = 0; k < P.serial_joints; ++k) {
        const int q = serial.joint[k]->coordinate;
        twist = twist + (s.da[q] * s.dz[q]) * Serial::unit_twist(e, *serial.joint[k], point);
      }
    }
    stepped_by = select(lanes, twist, stepped_by);
    stepped |= lanes;
  }

  /// What such steps change in the answer.
  void take_step() {
    if (!any(stepped)) return;
    for (int q = 0; q < P.coordinate_count; ++q) {
      const V step = select(stepped, s.rest[q], splat(0));
      s.x[q] += s.da[q] * step;
      s.tau[q] += s.dtau[q] * step;
    }
    const V6 twist = select(stepped, stepped_by, V6{});
    tip.p = tip.p + twist.a + cross(twist.b, tip.p - point);
    point = point + twist.a;
    for (V3& column : tip.R.c) column = column + cross(twist.b, column);
  }

  /// Frames and wrenches under the whole load at the coordinates found.
  void settle() {
    put_load(splat(1), splat(1));
    laws.evaluate(false);
    frames_and_wrenches();
    take_step();
  }

  /// The share that acts, and the one whose equilibrium is sought.
  void put_load(V share, V factor) {
    acting = share;
    ahead = factor - share;
    load = acting * whole_load;
    dead_load = load;
    pending = ahead * whole_load;
    e.gravity = acting * whole_gravity;
    e.pending = ahead * whole_gravity;
  }

  /// Lanes under no load at all.
  M unloaded_lanes() const {
    const V6& w = whole_load;
    const V sum = absolute(w.a.x) + absolute(w.a.y) + absolute(w.a.z) + absolute(w.b.x) + absolute(w.b.y) +
                  absolute(w.b.z) + (e.heavy ? splat(1) : splat(0));
    if (turning.several()) return (sum == 0.0) & ~turning.acting();
    return sum == 0.0;
  }

  /// Lanes whose load is not conservative, as `nonconservative` (load.hpp).
  M circulatory_lanes() const {
    const M here = TipLoads::circulatory(in.turns, whole_load);
    return turning.several() ? here | turning.circulatory() : here;
  }

  /// Whether corners can be crossed by deflections (F19).
  bool steps_by_deflections() const { return P.bends && P.serial_joints < 0; }

  /// Takes only a share of the last step.
  [[gnu::noinline]] void shorten(V share) {
    for (int q = 0; q < P.coordinate_count; ++q) s.dz[q] *= share;
    for (int k = 0; k < P.chain_count; ++k) {
      BranchSlot& b = s.branches[k];
      b.F = select(share < 1.0, b.before + share * (b.F - b.before), b.F);
    }
  }

  void move(M lanes) {
    for (int q = 0; q < P.coordinate_count; ++q) s.z[q] = select(lanes, s.z[q] + s.dz[q], s.z[q]);
  }

  static constexpr int most_iterations = 96;
  const double pivot_floor = 1e-5 * P.softest;
  static constexpr double longest = 0.05;  ///< step across corners
  static constexpr double small = 1e-13;   ///< step that changes the tangent by no more than that
  static constexpr double nothing = 1e-15;
  static constexpr double nearly = 5e-11;     ///< the same of an arm, of its softest direction's pivot
  static constexpr double chord_most = 6e-4;  ///< step before a chord step, of the softest direction's pivot
  static constexpr double chord_longest = 1e-5, chord_least = 1e-9;
  static constexpr double same_slope = 1e-11;  ///< change of a law's slope that the compliance does not show
  static constexpr double near_slope = 1e-7;   ///< the same where its first order is in the answer
  bool fresh = false;                          ///< frames and wrenches are those at the answer
};

}  // namespace stiffmap::kernel
