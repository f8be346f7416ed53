// SPDX-License-Identifier: MIT
// The commanded components of the tip's closure error: translations along base axes, rotations about the axes of
// the commanded frame. An open rotation may be far from the commanded one, so the sine of the error is
// differentiated exactly: a turn w of the end changes the sine vector from the end a to the target b by -D w,
// D w = (tr(Q) w - Q^T w) / 2, Q = R_b R_a^T.
#pragma once

#include "program.hpp"
#include "vectors.hpp"

namespace stiffmap::kernel {

struct TipTask {
  const Program& P;
  M3 end, target;
  V trace;

  TipTask(const Program& program, const M3& a, const M3& b)
      : P(program), end(a), target(b), trace(dot(a.c[0], b.c[0]) + dot(a.c[1], b.c[1]) + dot(a.c[2], b.c[2])) {}

  V6 only(V6 e) const {
    V* const part[6] = {&e.a.x, &e.a.y, &e.a.z, &e.b.x, &e.b.y, &e.b.z};
    for (int i = 0; i < 6; ++i)
      if (!P.task[i]) *part[i] = splat(0);
    return e;
  }
  V6 error(const V6& e) const { return only({e.a, target % e.b}); }
  V6 column(const V6& j) const {
    const V3 w = target % j.b;
    return only({j.a, splat(0.5) * (trace * w - target % (end * w))});
  }

  static bool any_rotation_open(const Program& P) { return !P.task[3] || !P.task[4] || !P.task[5]; }
};

}  // namespace stiffmap::kernel
