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

  /// How the wrench changes by a turn of the tip about each base axis.
  struct Change {
    V6 about[3];
    V6 by(const V3& turn) const { return turn.x * about[0] + turn.y * about[1] + turn.z * about[2]; }
  };
  Change change(const V6& w, const M3& R) const {
    Change out;
    if (how == LoadTurns::follower) {
      const V6 now = at(w, R);
      for (int k = 0; k < 3; ++k) out.about[k] = {cross(unit(k), now.a), cross(unit(k), now.b)};
      return out;
    }
    V3 axis{};  // d tr(Q) = axis · turn
    for (int k = 0; k < 3; ++k) axis = axis + cross(R.c[k], before.c[k]);
    for (int k = 0; k < 3; ++k)
      out.about[k] = {V3{}, splat(0.5) * (dot(axis, unit(k)) * w.b - back(cross(w.b, unit(k)), R))};
    return out;
  }

  /// Takes the change from the tangent of a dead wrench.
  [[gnu::noinline]] void soften(const V6& w, const M3& R, V (&m)[6][6]) const {
    const Change c = change(w, R);
    for (int k = 0; k < 3; ++k) {
      V column[6];
      put(c.about[k], column);
      for (int i = 0; i < 6; ++i) m[i][3 + k] -= column[i];
    }
  }

  /// From the symmetric part of a tangent that has the change to the one of a dead wrench.
  [[gnu::noinline]] void symmetric(const V6& w, const M3& R, Sym6& K) const {
    const Change c = change(w, R);
    const V3 &x = c.about[0].b, &y = c.about[1].b, &z = c.about[2].b;
    for (int k = 0; k < 3; ++k) K.B.c[k] = K.B.c[k] + splat(0.5) * c.about[k].a;
    K.E.xx += x.x;
    K.E.yy += y.y;
    K.E.zz += z.z;
    K.E.xy += 0.5 * (y.x + x.y);
    K.E.xz += 0.5 * (z.x + x.z);
    K.E.yz += 0.5 * (z.y + y.z);
  }

  static V3 unit(int k) { return {splat(k == 0), splat(k == 1), splat(k == 2)}; }

 private:
  V3 back(const V3& v, const M3& R) const { return before * (R % v); }
};

}  // namespace stiffmap::kernel
