// SPDX-License-Identifier: MIT
// Tangent of a serial arm in its joints alone: as many equations as joints, no wrench or tangent of the platform
// (docs/fast_path.md F14).
#pragma once

#include "free_play.hpp"
#include "laws.hpp"
#include "tip_loads.hpp"

namespace stiffmap::kernel {

/// What acts on an arm's tip.
struct TipLoad {
  V3 point;
  V6 load;              ///< of which the tangent knows, with the external springs
  V6 pending;           ///< of which it does not (F11)
  V3 dead_moment;       ///< of the loads, without lever arms
  M3 arms;              ///< sum of lever arms from the point times the loads' forces
  V3 spring_moment;     ///< of the external springs
  const Sym6* springs;  ///< tangent of the external springs at the point; null: none
  V6 given;             ///< the load at the point, as at the command
  V share;              ///< of all loads, that acts
  const TipLoads& turning;
  const M3& R;  ///< of the tip
};

struct Serial {
  V B[most_serial_joints][most_serial_joints];  ///< eliminated: multipliers, inverse pivots, rows
  const Op* joint[most_serial_joints];
  V6 twist[most_serial_joints];  ///< of the point by a unit of each joint, at the answer
  V bent[most_serial_joints];    ///< change of each joint's stiffness by the last step
  FreePlay play;

  Serial() {}  // not filled with zeros: 10 kB

  static constexpr double regular = 1e-7;  ///< least pivot of a compliance, of its diagonal: else the reference decides

  /// Steps of all joints.
  void step(Elimination& el, const TipLoad& tip) {
    return el.P.serial_joints == 6 ? step_of<6>(el, tip) : step_of<0>(el, tip);
  }

  /// Compliance J diag(a') B^-1 J^T of a dead wrench at `point`, and its inverse, the symmetric part of it; with J
  /// and the laws' slopes where the last step leads in the lanes `moved`, to first order.
  void answer(Elimination& el, const V3& point, M moved, V (&C)[6][6], Sym6& K) {
    twists_after(el, point, moved);
    bend(el, moved);
    if (el.P.hardens) return el.P.serial_joints == 6 ? answer_of<6, true>(el, C, K) : answer_of<0, true>(el, C, K);
    return el.P.serial_joints == 6 ? answer_of<6, false>(el, C, K) : answer_of<0, false>(el, C, K);
  }

  /// Twist of the point by a unit of the joint.
  static V6 unit_twist(const Elimination& el, const Op& op, const V3& point) {
    const JointSlot& j = el.s.joints[op.slot];
    return op.kind == OpKind::prismatic ? V6{j.w, V3{}} : V6{cross(j.w, point - j.o), j.w};
  }

 private:
  /// Unit twists of the point after the last step in the lanes `moved`, before it in the others.
  [[gnu::noinline]] void twists_after(const Elimination& el, V3 point, M moved) {
    const int n = el.P.serial_joints;
    V3 w[most_serial_joints], o[most_serial_joints];
    for (int k = 0; k < n; ++k) {
      const JointSlot& j = el.s.joints[joint[k]->slot];
      w[k] = j.w;
      o[k] = j.o;
    }
    if (any(moved)) {
      V6 motion{};  // of what the joints so far carry, about the origin
      for (int k = 0; k < n; ++k) {
        const int q = joint[k]->coordinate;
        const V step = select(moved, el.s.da[q] * el.s.dz[q], splat(0));
        const V3 axis = step * w[k], at = cross(o[k], axis);
        w[k] = w[k] + cross(motion.b, w[k]);
        o[k] = o[k] + motion.a + cross(motion.b, o[k]);
        const bool slides = joint[k]->kind == OpKind::prismatic;
        motion = motion + (slides ? V6{axis, V3{}} : V6{at, axis});
      }
      point = point + motion.a + cross(motion.b, point);
    }
    for (int k = 0; k < n; ++k)
      twist[k] = joint[k]->kind == OpKind::prismatic ? V6{w[k], V3{}} : V6{cross(w[k], point - o[k]), w[k]};
  }

  void bend(const Elimination& el, M moved) {
    for (int k = 0; el.P.hardens && k < el.P.serial_joints; ++k)
      bent[k] = select(moved, slope_change(el.P, el.s, joint[k]->coordinate), splat(0));
  }

  /// The external springs' tangent in the joints; their moment turns by half where the joints' axes do (F15).
  [[gnu::noinline]] void pull_back(const Elimination& el, int n, const TipLoad& tip) {
    const V3 half = splat(0.5) * tip.spring_moment;
    V6 unit[most_serial_joints];
    for (int b = 0; b < n; ++b) {
      unit[b] = unit_twist(el, *joint[b], tip.point);
      V6 force = *tip.springs * unit[b];
      force.b = force.b - cross(unit[b].b, half);
      for (int a = 0; a <= b; ++a) {
        const V more = dot(unit[a], force);
        B[a][b] += more;
        if (a < b) B[b][a] += more;
      }
    }
  }

  /// The load turns with the tip.
  template <int N>
  [[gnu::noinline]] void turn(const Elimination& el, int count, const TipLoad& tip) {
    const int n = N ? N : count;
    const bool follows = tip.turning.one_follower();
    Change change;
    V6 now;
    if (follows) now = tip.share * tip.turning.at(tip.given, tip.R);
    else change = tip.turning.change(tip.given, tip.R, false);
    V6 unit[most_serial_joints];
    for (int b = 0; b < n; ++b) unit[b] = unit_twist(el, *joint[b], tip.point);
    for (int b = 0; b < n; ++b) {
      if (joint[b]->kind == OpKind::prismatic) continue;
      const V3& w = unit[b].b;
      const V6 more = follows ? V6{cross(w, now.a), cross(w, now.b)} : tip.share * change.by(w);
#pragma GCC unroll 6
      for (int a = 0; a < n; ++a) B[a][b] -= dot(unit[a], more);
    }
  }

  /// What turns with the joints: before the first step under a load (F11) nothing does.
  enum class Acts { nothing, forces, moment };
  [[gnu::always_inline]] static Acts acts(const Elimination& el, const TipLoad& tip) {
    const auto some = [](const V3& v) { return any((v.x != 0.0) | (v.y != 0.0) | (v.z != 0.0)); };
    if (some(tip.dead_moment)) return Acts::moment;
    // Several loads may turn with the joints where their sum is nothing.
    if (tip.turning.several() && any(tip.share != 0.0)) return Acts::forces;
    return some(tip.load.a) || some(tip.load.b) || (el.heavy && some(el.gravity)) ? Acts::forces : Acts::nothing;
  }

  /// N joints; 0: as many as there are.
  template <int N>
  [[gnu::noinline]] void step_of(Elimination& el, const TipLoad& tip) {
    const Program& P = el.P;
    const int n = N ? N : P.serial_joints;
    const Acts how = acts(el, tip);
    V g[most_serial_joints];
    for (int i = 0, k = 0; i < P.serial_count; ++i)
      if (P.ops[P.serial[i]].kind != OpKind::load) joint[k++] = P.ops + P.serial[i];
    // Of all that acts behind the joint: force, and the sum of its lever arms times forces; with what is pending, force
    // and moment about the joint.
    V3 point = tip.point, force = tip.load.a, all = force + tip.pending.a, moment = tip.load.b + tip.pending.b;
    M3 arms = tip.arms;
    int b = n - 1;
    for (int i = P.serial_count - 1; i >= 0; --i) {
      const Op& op = P.ops[P.serial[i]];
      const JointSlot& j = el.s.joints[op.slot];
      const V3 r = point - j.o;
      add_lever(arms, r, force);
      moment = moment + cross(r, all);
      point = j.o;
      if (op.kind == OpKind::load) {
        if (!el.heavy) continue;
        const V3 weight = splat(op.mass) * el.gravity, whole = weight + splat(op.mass) * el.pending;
        add_lever(arms, j.w, weight);
        force = force + weight;
        moment = moment + cross(j.w, whole);
        all = all + whole;
        continue;
      }
      const bool turns = op.kind == OpKind::revolute;
      if (how == Acts::nothing) {
        for (int a = 0; a <= b; ++a) B[a][b] = B[b][a] = splat(0);
      } else {
        const V3 below = turns ? arms * j.w - trace(arms) * j.w : cross(j.w, force);
        couple(el, b, below, turns && how == Acts::moment ? cross(j.w, tip.dead_moment) : V3{}, how);
      }
      g[b] = dot(j.w, turns ? moment : all) - el.s.tau[op.coordinate];
      --b;
    }
    if (tip.springs) pull_back(el, n, tip);
    if (tip.turning.some_turns() && how != Acts::nothing) turn<N>(el, n, tip);
    for (int k = 0; k < n; ++k) {
      const int q = joint[k]->coordinate;
      for (int i = 0; i < n; ++i) B[i][k] *= el.s.da[q];
      B[k][k] += el.s.dtau[q];
    }
    if (P.starts_linear) play.hold(el, joint, n, B, g);
    factor<N>(el, n, how == Acts::nothing && !tip.springs);
    solve<N>(n, g);
    for (int k = 0; k < n; ++k) el.s.dz[joint[k]->coordinate] = g[k];
  }

  /// How the forces of the joints before `b` and its own turn with each other: theory E4, a dead moment's share above.
  void couple(const Elimination& el, int b, const V3& below, const V3& moment, Acts how) {
    for (int a = 0; a <= b; ++a) {
      const bool both = joint[a]->kind == OpKind::revolute;
      const V3& w = el.s.joints[joint[a]->slot].w;
      B[a][b] = both ? -dot(w, below) : splat(0);
      B[b][a] = how == Acts::moment && both ? -dot(w, below + moment) : B[a][b];
    }
  }

  template <int N>
  void factor(Elimination& el, int count, bool diagonal) {
    const int n = N ? N : count;
#pragma GCC unroll 6
    for (int k = 0; k < n; ++k) {
      el.guard(B[k][k], el.P.coordinates[joint[k]->coordinate].unit);
      B[k][k] = 1.0 / B[k][k];
      if (diagonal) continue;
#pragma GCC unroll 6
      for (int i = k + 1; i < n; ++i) {
        B[i][k] *= B[k][k];
#pragma GCC unroll 6
        for (int c = k + 1; c < n; ++c) B[i][c] -= B[i][k] * B[k][c];
      }
    }
  }

  template <int N, bool bends>
  [[gnu::noinline]] void answer_of(Elimination& el, V (&C)[6][6], Sym6& K) const {
    const int n = N ? N : el.P.serial_joints;
    V J[6][most_serial_joints], m[6][6], x[6][6];
    for (int k = 0; k < n; ++k) {
      V column[6];
      put(twist[k], column);
      for (int i = 0; i < 6; ++i) J[i][k] = column[i];
    }
    for (int r = 0; r < 6; ++r) {
      V g[most_serial_joints];
      for (int k = 0; k < n; ++k) g[k] = J[r][k];
      solve<N>(n, g);
      for (int k = 0; k < n; ++k) g[k] *= el.s.da[joint[k]->coordinate];
      if constexpr (bends) {
        for (int k = 0; k < n; ++k) g[k] = J[r][k] - bent[k] * g[k];
        solve<N>(n, g);
        for (int k = 0; k < n; ++k) g[k] *= el.s.da[joint[k]->coordinate];
      }
#pragma GCC unroll 6
      for (int i = 0; i < 6; ++i) {
        C[i][r] = n > 0 ? J[i][0] * g[0] : splat(0);  // nothing yields
#pragma GCC unroll 6
        for (int k = 1; k < n; ++k) C[i][r] += J[i][k] * g[k];
      }
    }
    if (el.P.deficient) {
      const V3 none{splat(__builtin_nan("")), splat(__builtin_nan("")), splat(__builtin_nan(""))};
      K = {{none.x, none.x, none.x, none.x, none.x, none.x},
           {none, none, none},
           {none.x, none.x, none.x, none.x, none.x, none.x}};
      return;
    }
    M sound = ~M{};
    for (int i = 0; i < 6; ++i)
      for (int q = 0; q < 6; ++q) {
        m[i][q] = C[i][q];
        x[i][q] = splat(i == q ? 1 : 0);
      }
#pragma GCC unroll 6
    for (int k = 0; k < 6; ++k) {
      sound &= m[k][k] > regular * C[k][k];
      const V inverse = 1.0 / m[k][k];
#pragma GCC unroll 6
      for (int q = 0; q < 6; ++q) (q > k ? m : x)[k][q] *= inverse;
#pragma GCC unroll 6
      for (int i = 0; i < 6; ++i) {
        if (i == k) continue;
        const V f = m[i][k];
#pragma GCC unroll 6
        for (int q = 0; q < 6; ++q) (q > k ? m : x)[i][q] -= f * (q > k ? m : x)[k][q];
      }
    }
    const auto mean = [&](int i, int q) { return 0.5 * (x[i][q] + x[q][i]); };
    K.A = {x[0][0], x[1][1], x[2][2], mean(0, 1), mean(0, 2), mean(1, 2)};
    for (int q = 0; q < 3; ++q) K.B.c[q] = {mean(0, 3 + q), mean(1, 3 + q), mean(2, 3 + q)};
    K.E = {x[3][3], x[4][4], x[5][5], mean(3, 4), mean(3, 5), mean(4, 5)};
    el.lowest = select(sound, el.lowest, splat(-1));
  }

  template <int N>
  void solve(int count, V* g) const {
    const int n = N ? N : count;
#pragma GCC unroll 6
    for (int i = 1; i < n; ++i)
#pragma GCC unroll 6
      for (int k = 0; k < i; ++k) g[i] -= B[i][k] * g[k];
#pragma GCC unroll 6
    for (int k = n - 1; k >= 0; --k) {
#pragma GCC unroll 6
      for (int c = k + 1; c < n; ++c) g[k] -= B[k][c] * g[c];
      g[k] *= B[k][k];
    }
  }
};

}  // namespace stiffmap::kernel
