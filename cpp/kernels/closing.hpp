// SPDX-License-Identifier: MIT
// Closure of each leg in lanes: Gauss-Newton on the normal equations from a good start, with the same
// trust test as the reference closure. A lane that fails it is left to the reference path.
#pragma once

#include "approach.hpp"
#include "arm.hpp"
#include "frames.hpp"
#include "nearest.hpp"
#include "normal_equations.hpp"
#include "planar.hpp"
#include "reach.hpp"
#include "starts.hpp"

namespace stiffmap::kernel {

inline constexpr int most_closure_steps = 12;
inline constexpr int most_leaps = 48;
inline constexpr double shortest_leap = 1.0 / 1024;  // of the way
inline constexpr double trusted_step = 0.25;         // first Gauss-Newton step, relative to the length
inline constexpr double closed = 1e-12;              // largest error, relative to the length
inline constexpr double exact = 3e-15;               // the same: a closed form needs no step
inline constexpr double last_step = 1e-8;            // its square, what it leaves, is below round-off

struct Closing {
  const Program& P;
  Scratch& s;

  M never = {};  ///< lanes whose pose is out of reach: beyond a leg's length, or as far as descents can tell

  /// Closes the legs to `tip`, whose position is at[lane]; returns the lanes that closed, coordinates
  /// in s.x. Where the start was too far and there is patience, the nearest node is continued in leaps.
  M close(const Frame& tip, const double* const (&at)[W], bool patient) {
    for (int q = 0; q < P.coordinate_count; ++q) s.x[q] = splat(P.coordinates[q].role == 2 ? 0 : P.coordinates[q].home);
    if (P.reach) never = beyond_reach(P, tip);
    const M usable = start(tip, at) & ~never;
    const M ok = reach(tip, usable);
    if (P.planar || !patient || all(ok | never)) return ok;
    return ok | leap(tip, at, ~ok & ~never);
  }

  M start(const Frame& tip, const double* const (&at)[W]) {
    M usable{};
    if (P.planar) {
      const Frame end = legs_end(tip);
      usable = ~usable;
      for (int k = 0; k < P.leg_count; ++k) usable &= close_planar(P.planar[k], end, s.x, never);
      return usable;
    }
    const M sure = P.arm ? close_arm(*P.first_turn, *P.arm, legs_end(tip), s.x) : M{};
    if (all(sure)) return sure;
    alignas(64) double rows[W][most_closure_unknowns];
    for (int i = 0; i < W; ++i) usable[i] = !sure[i] && Starts{P}.interpolate(at[i], rows[i]) ? -1 : 0;
    for (int j = 0; j < P.unknown_count; ++j)
      for (int i = 0; i < W; ++i)
        if (usable[i]) s.x[P.unknowns[j]][i] = rows[i][j];
    return usable | sure;
  }

  /// Adaptive continuation of theory (C5), each lane by its own leaps, from the node of the grid that is nearest
  /// (home where there is none; of an arm home, turned towards the pose) straight to the pose.
  M leap(const Frame& tip, const double* const (&at)[W], M moving) {
    Frame from = home();
    M closed_lanes{}, stuck{};
    for (int q = 0; q < P.coordinate_count; ++q)
      if (P.coordinates[q].role != 2) s.x[q] = select(moving, splat(P.coordinates[q].home), s.x[q]);
    if (P.arm) turn_home(*P.first_turn, tip.p, moving, from, s.x);
    for (int i = 0; i < W && !P.arm; ++i) {
      if (!moving[i]) continue;
      double node[3];
      const double* row = Starts{P}.nearest(at[i], node);
      if (!row) continue;
      from.p.x[i] = node[0];
      from.p.y[i] = node[1];
      from.p.z[i] = node[2];
      for (int j = 0; j < P.unknown_count; ++j) s.x[P.unknowns[j]][i] = row[j];
    }
    const V3 turn = rotation_between(from.R, tip.R);
    // What is not a number can not be reached.
    stuck |= moving & ~((dot(tip.p, tip.p) + dot(turn, turn)) < 1e200);
    moving &= ~stuck;
    V reached = splat(0), stride = splat(0.5);
    keep(moving);
    for (int k = 0; k < most_leaps && any(moving); ++k) {
      const V goal = select(reached + stride < 1.0, reached + stride, splat(1));
      const M last = goal == 1.0;
      const Frame way = between(from, turn, tip, goal, last);
      const M got = reach(way, moving), lost = moving & ~got;
      reached = select(got, goal, reached);
      stride = select(got, 2.0 * stride, select(lost, 0.5 * stride, stride));
      for (int q = 0; q < P.coordinate_count; ++q) s.x[q] = select(lost, s.kept[q], s.x[q]);
      keep(got);
      closed_lanes |= got & last;
      stuck |= lost & (stride < shortest_leap);
      moving &= ~closed_lanes & ~stuck;
    }
    stuck |= moving;
    if (any(stuck)) never |= out_of_reach(tip, stuck);
    return closed_lanes;
  }

  void keep(M lanes) {
    for (int q = 0; q < P.coordinate_count; ++q) s.kept[q] = select(lanes, s.x[q], s.kept[q]);
  }

  Frame home() const {
    return {{splat(P.home_p[0]), splat(P.home_p[1]), splat(P.home_p[2])}, constant_rotation(P.home_R)};
  }

  static Frame between(const Frame& from, const V3& turn, const Frame& tip, V share, M last) {
    Frame way = tip;
    way.p = select(last, tip.p, from.p + share * (tip.p - from.p));
    const M3 turned = turned_by(from.R, share * turn);
    for (int i = 0; i < 3; ++i) way.R.c[i] = select(last, tip.R.c[i], turned.c[i]);
    return way;
  }

  /// Lanes where a leg stays away from `tip` in descents from the present coordinates, from home, and of an arm from
  /// home turned towards it.
  M out_of_reach(const Frame& tip, M lanes) {
    M no = lanes;
    for (int attempt = 0; attempt < (P.first_turn ? 3 : 2) && any(no); ++attempt) {
      if (attempt > 0) {
        for (int q = 0; q < P.coordinate_count; ++q)
          if (P.coordinates[q].role != 2) s.x[q] = select(no, splat(P.coordinates[q].home), s.x[q]);
        Frame there = home();
        if (attempt == 2) turn_home(*P.first_turn, tip.p, no, there, s.x);
      }
      M some{};
      each_leg(tip, [&](const LegClosure& leg, int chain, const Frame& before, const Frame& after) {
        const M left = no & ~some;
        if (any(left)) some |= Approach{P, s}.stays_away(*this, leg, chain, before, after, left);
      });
      no &= some;
    }
    return no;
  }

  M reach(const Frame& tip, M usable) {
    M ok = usable;
    each_leg(tip, [&](const LegClosure& leg, int chain, const Frame& before, const Frame& after) {
      ok &= close_leg(leg, chain, before, after, ok);
    });
    return ok;
  }

  /// Calls with each set of equations that closes by itself: a leg between its fixed frames, or the whole machine.
  template <class Call>
  void each_leg(const Frame& tip, const Call& call) {
    Frame before = base_frame();
    if (P.closes == 2) return call(P.legs[0], P.root, before, tip);
    const ChainProgram& root = P.chains[P.root];
    const Frame after = legs_end(tip);
    for (int i = root.first; i <= P.legs_op; ++i) apply(P.ops[i].nominal, before);
    const Op& block = P.ops[P.legs_op];
    for (int k = 0; k < block.count; ++k) call(P.legs[k], block.first + k, before, after);
  }

  static Frame base_frame() {
    const V o = splat(0), l = splat(1);
    return {{o, o, o}, {{{l, o, o}, {o, l, o}, {o, o, l}}}};
  }

  /// The legs end where the platform's constant transforms begin.
  Frame legs_end(const Frame& tip) const {
    Frame after = tip;
    const ChainProgram& root = P.chains[P.root];
    undo(root.nominal, after);
    for (int i = root.first + root.count - 1; i > P.legs_op; --i) undo(P.ops[i].nominal, after);
    return after;
  }

  [[gnu::always_inline]] static void undo(const Constant& T, Frame& f) {
    if (T.has_rotation) {
      const M3 R = f.R;
      for (int i = 0; i < 3; ++i) {
        V3 column{splat(0), splat(0), splat(0)};
        for (int k = 0; k < 3; ++k) column = column + splat(T.R[3 * k + i]) * R.c[k];
        f.R.c[i] = column;
      }
    }
    if (T.has_translation) f.p = f.p - f.R * V3{splat(T.p[0]), splat(T.p[1]), splat(T.p[2])};
  }

  M close_leg(const LegClosure& leg, int chain, const Frame& start, const Frame& target, M usable) {
    const std::int32_t* unknown = P.unknowns + leg.first_unknown;
    if (P.nearness) return close_nearest(leg, chain, start, target, usable);
    M done{}, failed = ~usable;
    V previous = splat(1);
    NormalEquations equations;
    for (int step = 0; step < most_closure_steps; ++step) {
      V6 errors[most_unknowns];
      const V error = closure_errors(leg, chain, start, target, errors);
      if (P.planar || P.arm || step > 0) done |= ~failed & ((error < exact) | ((error < closed) & (previous < 1e-7)));
      failed |= ~done & ~(error < 1e100);
      if (all(done | failed)) break;
      equations.assemble(P, s, leg, errors, target.R);
      V missing = equations.solve(leg.unknowns);
      V norm = splat(0);
      for (int k = 0; k < leg.unknowns; ++k) norm += equations.g[k] * equations.g[k];
      norm = root(norm) * (1 / P.length);
      failed |= ~done & ~(norm < trusted_step);
      if (step > 0) failed |= ~done & ~((norm <= 0.25 * previous) | (norm < 1e-9));
      const M active = ~done & ~failed;
      for (int k = 0; k < leg.unknowns; ++k) {
        V& x = s.x[unknown[k]];
        x = select(active, x + equations.g[k] * (1 / P.coordinates[unknown[k]].unit), x);
      }
      // What the step leaves: the equations' misfit and terms of its square.
      done |= active & (norm < last_step) & (missing < closed * closed * P.length * P.length);
      if (all(done | failed)) break;
      previous = select(active, norm, previous);
    }
    return done;
  }

  /// The same of a leg with more joints than its end commands: the nearest to home (F25).
  [[gnu::noinline]] M close_nearest(const LegClosure& leg, int chain, const Frame& start, const Frame& target,
                                    M usable) {
    M done{}, failed = ~usable;
    V previous = splat(1);
    Nearest nearest(P, s, leg);
    for (int step = 0; step < most_closure_steps; ++step) {
      V6 errors[most_unknowns];
      const V error = closure_errors(leg, chain, start, target, errors);
      failed |= ~done & ~(error < 1e100);
      if (all(done | failed)) break;
      nearest.place(errors[0], s.branches[chain].end.p);
      if (step == 0) failed |= ~done & ~nearest.solve(false);
      failed |= ~done & ~nearest.solve(true);
      const V norm = nearest.norm();
      failed |= ~done & ~(norm < trusted_step);
      if (step > 0) failed |= ~done & ~((norm <= 0.25 * previous) | (norm < 1e-9));
      const M active = ~done & ~failed;
      nearest.move(active);
      done |= active & (norm < last_step);
      if (all(done | failed)) break;
      previous = select(active, norm, previous);
    }
    return done;
  }

  /// Twists that are missing at each closure, sines of the angles as lengths; returns the largest over
  /// the length, infinite beyond a right angle.
  V closure_errors(const LegClosure& leg, int chain, const Frame& start, const Frame& target, V6* errors) {
    Frame end = start;
    walk<Build::nominal>(P, P.chains[chain], s.x, end, s);
    s.branches[chain].end = end;
    V worst = splat(0);
    for (int q = 0; q < leg.equations; ++q) {
      const ClosureEquation& eq = P.equations[leg.first_equation + q];
      const Frame& a = s.branches[eq.chain].end;
      const Frame& b = eq.primary < 0 ? target : s.branches[eq.primary].end;
      V cosine;
      V6& e = errors[q];
      e = {b.p - a.p, splat(P.length) * sine_between(a.R, b.R, cosine)};
      const bool part = eq.primary < 0 && P.open_task;
      if (part) e = TipTask(P, a.R, b.R).error(e);
      worst = larger(worst, larger(larger(absolute(e.a.x), absolute(e.a.y)), absolute(e.a.z)));
      worst = larger(worst, larger(larger(absolute(e.b.x), absolute(e.b.y)), absolute(e.b.z)));
      if (part && TipTask::any_rotation_open(P)) continue;
      worst = select(cosine > 0.0, worst, splat(1e200));
    }
    return worst * (1 / P.length);
  }
};

}  // namespace stiffmap::kernel
