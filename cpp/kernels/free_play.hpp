// SPDX-License-Identifier: MIT
// Joints of an arm inside their gap that bear nothing: the pose is singular, one joint plays freely
// (docs/fast_path.md F16). What is not decided beyond round-off is left to the reference path.
#pragma once

#include "elimination.hpp"

namespace stiffmap::kernel {

inline constexpr int most_serial_joints = 12;

struct FreePlay {
  M loose[most_serial_joints];  ///< lanes in which the joint plays
  M lanes = {};                 ///< in which one does
  M doubtful = {};              ///< in which a gap is open, but not clearly
  bool decides = false;         ///< at the first step after the laws were placed
  V6 twist{};                   ///< of the point by the joint that plays

  static constexpr double coupled = 1e-10;  ///< of a loose joint to the others, relative; the reference's rank: 1e-7
  static constexpr double unloaded =
      1e-15;  ///< its force, of its own stiffness times the length; the reference's: 1e-14
  static constexpr double far_apart = 1e5;  ///< bound of the other directions' condition

  /// Finds the loose joints in the tangent B and the forces g before they are eliminated, and holds them there by the
  /// stiffness that they have beyond the gap.
  [[gnu::noinline]] void hold(const Elimination& el, const Op* const* joint, int n, V (*B)[most_serial_joints], V* g) {
    const M before = lanes;
    if (decides) lanes = M{};
    doubtful = M{};
    if (!decides && !any(before)) return;
    for (int k = 0; k < n; ++k) {
      const int q = joint[k]->coordinate;
      const M open = is_gap(el.P, q) ? (el.s.dtau[q] == 0.0) & (el.s.da[q] != 0.0) : M{};
      if (decides) loose[k] = open & (el.s.z[q] == 0.0);
      else doubtful |= loose[k] & ~open;
      if (decides) doubtful |= open & (~loose[k] | lanes);  // two at once are the reference's
      lanes |= loose[k];
      if (!any(loose[k])) continue;
      const double unit = el.P.coordinates[q].unit, force = unloaded * el.P.length / unit;
      const V own = stiffness(el, q);
      M bears = ~(absolute(g[k]) <= force * el.P.laws[el.P.coordinates[q].law].stiffness);
      for (int i = 0; i < n; ++i) {
        const V most = coupled * coupled * own * stiffness(el, joint[i]->coordinate);
        bears |= ~((B[i][k] * B[i][k] <= most) & (B[k][i] * B[k][i] <= most));
        B[i][k] = select(loose[k], splat(0), B[i][k]);
        B[k][i] = select(loose[k], splat(0), B[k][i]);
      }
      doubtful |= loose[k] & bears;
      B[k][k] = select(loose[k], own, B[k][k]);
      g[k] = select(loose[k], splat(0), g[k]);
    }
    if (el.P.deficient) doubtful |= lanes;
    lanes &= ~doubtful;
  }

  /// From the held joint's stiffness K and compliance C at the point to those of the joint that plays: K loses the
  /// direction in which it moves the point, C has no numbers. `unit` are the joints' unit twists.
  [[gnu::noinline]] void release(Elimination& el, int n, const V6* unit, V (&C)[6][6], Sym6& K) {
    V stiff = splat(0), soft = splat(0);
    const V own[6] = {K.A.xx, K.A.yy, K.A.zz, K.E.xx, K.E.yy, K.E.zz};
    for (int i = 0; i < 6; ++i) {
      const double size = el.scale[i] * el.scale[i];
      stiff += own[i] * (1 / size);
      soft += C[i][i] * size;
    }
    V6 moved = twist;
    for (int k = 0; k < n; ++k) moved = select(loose[k], unit[k], moved);
    twist = select(lanes, moved, twist);
    const V6 force = K * twist;
    Sym6 left = K;
    downdate(left, force, 1.0 / dot(twist, force));
    K = select(lanes, left, K);
    el.lowest = select(lanes & ~(stiff * soft < far_apart), splat(-1), el.lowest);
    for (int i = 0; i < 6; ++i)
      for (int q = 0; q < 6; ++q) C[i][q] = select(lanes, splat(__builtin_nan("")), C[i][q]);
  }

 private:
  static bool is_gap(const Program& P, int q) {
    const CoordinateProgram& k = P.coordinates[q];
    return k.law >= 0 && !k.locked && P.laws[k.law].count > 0;
  }

  /// Of a joint without its gap.
  static V stiffness(const Elimination& el, int q) {
    const CoordinateProgram& k = el.P.coordinates[q];
    if (k.law >= 0) return el.s.linear[q];
    return splat(k.stiffness > 0 ? k.stiffness : el.P.stiffness * k.unit * k.unit);
  }
};

}  // namespace stiffmap::kernel
