// SPDX-License-Identifier: MIT
// One load of the tip's body as the body turns (theory E6): dead, follower, semitangential (docs/fast_path.md F18).
#pragma once

#include "program.hpp"
#include "sym6.hpp"

namespace stiffmap::kernel {

/// How a wrench changes by a turn of the tip about each base axis.
struct Change {
  V6 about[3];
  V6 by(const V3& turn) const { return turn.x * about[0] + turn.y * about[1] + turn.z * about[2]; }
};

struct TurningLoad {
  LoadTurns how = LoadTurns::dead;
  const M3& before;  ///< the tip's rotation at the command

  /// The wrench w, given at the command, where the tip stands at R.
  [[gnu::noinline]] V6 at(const V6& w, const M3& R) const {
    if (how == LoadTurns::dead) return w;
    if (how == LoadTurns::follower) return {R * (before % w.a), R * (before % w.b)};
    const V trace = dot(R.c[0], before.c[0]) + dot(R.c[1], before.c[1]) + dot(R.c[2], before.c[2]);
    return {w.a, splat(0.5) * (trace * w.b - back(w.b, R))};
  }

  [[gnu::noinline]] Change change(const V6& w, const M3& R) const {
    Change out{};
    if (how == LoadTurns::dead) return out;
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

  static V3 unit(int k) { return {splat(k == 0), splat(k == 1), splat(k == 2)}; }

 private:
  V3 back(const V3& v, const M3& R) const { return before * (R % v); }
};

}  // namespace stiffmap::kernel
