// SPDX-License-Identifier: MIT
// Loads that turn with the tip: follower and semitangential (theory E6), and what that adds to the tangent of a dead
// wrench (docs/fast_path.md F18). Apart from the other passes: dead loads keep their code and their bits.
#pragma once

#include "program.hpp"
#include "sym6.hpp"

namespace stiffmap::kernel {

struct TurningLoad {
  LoadTurns how = LoadTurns::dead;
  M3 before = {};  ///< the tip's rotation at the command

  bool turns() const { return how != LoadTurns::dead; }

  /// The wrench w, given at the command, where the tip stands at R.
  [[gnu::noinline]] V6 at(const V6& w, const M3& R) const {
    if (how == LoadTurns::follower) return {R * (before % w.a), R * (before % w.b)};
    const V trace = dot(R.c[0], before.c[0]) + dot(R.c[1], before.c[1]) + dot(R.c[2], before.c[2]);
    return {w.a, splat(0.5) * (trace * w.b - back(w.b, R))};
  }

  /// How the wrench changes by a turn of the tip.
  V6 change(const V6& w, const M3& R, const V3& by) const {
    if (how == LoadTurns::follower) return {cross(by, R * (before % w.a)), cross(by, R * (before % w.b))};
    V3 axis{};  // d tr(Q) = axis · turn
    for (int k = 0; k < 3; ++k) axis = axis + cross(R.c[k], before.c[k]);
    return {V3{}, splat(0.5) * (dot(axis, by) * w.b - back(cross(w.b, by), R))};
  }

  /// Takes the change from the tangent of a dead wrench.
  [[gnu::noinline]] void soften(const V6& w, const M3& R, V (&m)[6][6]) const {
    for (int k = 0; k < 3; ++k) {
      V column[6];
      put(change(w, R, unit(k)), column);
      for (int i = 0; i < 6; ++i) m[i][3 + k] -= column[i];
    }
  }

  /// From the symmetric part of a tangent that has the change to the one of a dead wrench.
  [[gnu::noinline]] void symmetric(const V6& w, const M3& R, Sym6& K) const {
    V3 force[3], moment[3];
    for (int k = 0; k < 3; ++k) {
      const V6 c = change(w, R, unit(k));
      force[k] = c.a;
      moment[k] = c.b;
    }
    for (int k = 0; k < 3; ++k) K.B.c[k] = K.B.c[k] + splat(0.5) * force[k];
    K.E.xx += moment[0].x;
    K.E.yy += moment[1].y;
    K.E.zz += moment[2].z;
    K.E.xy += 0.5 * (moment[1].x + moment[0].y);
    K.E.xz += 0.5 * (moment[2].x + moment[0].z);
    K.E.yz += 0.5 * (moment[2].y + moment[1].z);
  }

  static V3 unit(int k) { return {splat(k == 0), splat(k == 1), splat(k == 2)}; }

 private:
  V3 back(const V3& v, const M3& R) const { return before * (R % v); }
};

}  // namespace stiffmap::kernel
