// SPDX-License-Identifier: MIT
// Forward kinematics of a block of poses.
#pragma once

#include "slots.hpp"

namespace stiffmap::kernel {

inline M3 constant_rotation(const double* R) {
  M3 out;
  for (int k = 0; k < 3; ++k) out.c[k] = {splat(R[3 * k]), splat(R[3 * k + 1]), splat(R[3 * k + 2])};
  return out;
}

inline void apply(const Constant& T, Frame& f) {
  if (T.has_translation) {
    if (T.p[0] != 0) f.p = f.p + splat(T.p[0]) * f.R.c[0];
    if (T.p[1] != 0) f.p = f.p + splat(T.p[1]) * f.R.c[1];
    if (T.p[2] != 0) f.p = f.p + splat(T.p[2]) * f.R.c[2];
  }
  if (T.has_rotation) {
    const M3 R = f.R;
    for (int k = 0; k < 3; ++k) {
      V3 column{splat(0), splat(0), splat(0)};
      for (int i = 0; i < 3; ++i)
        if (T.R[3 * k + i] != 0) column = column + splat(T.R[3 * k + i]) * R.c[i];
      f.R.c[k] = column;
    }
  }
}

/// R times the rotation by angle about a unit axis of its own frame.
inline void turn(M3& R, int axis, V s, V c) {
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  const V3 u = R.c[i], v = R.c[j];
  R.c[i] = c * u + s * v;
  R.c[j] = c * v - s * u;
}

[[gnu::always_inline]] inline void turn_about(M3& R, const double* d, V s, V c) {
  const V h = 1.0 - c;
  const V x = splat(d[0]), y = splat(d[1]), z = splat(d[2]);
  const M3 Q{{{c + h * x * x, h * x * y + s * z, h * x * z - s * y},
              {h * x * y - s * z, c + h * y * y, h * y * z + s * x},
              {h * x * z + s * y, h * y * z - s * x, c + h * z * z}}};
  R = R * Q;
}

inline V3 axis_of(const Op& op, const M3& R) {
  if (op.axis < 3) return R.c[op.axis];
  return R * V3{splat(op.direction[0]), splat(op.direction[1]), splat(op.direction[2])};
}

[[gnu::always_inline]] inline void move_joint(const Op& op, V q, Frame& f, JointSlot& slot) {
  slot.w = axis_of(op, f.R);
  if (op.kind == OpKind::prismatic) {
    f.p = f.p + q * slot.w;
  } else {
    V s, c;
    sincos(q, s, c);
    if (op.axis < 3) turn(f.R, op.axis, s, c);
    else turn_about(f.R, op.direction, s, c);
  }
  slot.o = f.p;
}

/// p + R t, R Rx Ry Rz; Z turns moments by its own coordinates into moments in base axes (F5).
[[gnu::always_inline]] inline void move_spring(const V* x, Frame& f, StiffSlot& slot) {
  slot.start = f;
  f.p = f.p + f.R * V3{x[0], x[1], x[2]};
  slot.p = f.p;
  V sa, ca, sb, cb, sc, cc;
  sincos(x[3], sa, ca);
  sincos(x[4], sb, cb);
  sincos(x[5], sc, cc);
  const M3 R = f.R;
  turn(f.R, 0, sa, ca);
  turn(f.R, 1, sb, cb);
  turn(f.R, 2, sc, cc);
  // Columns of R E^-T with E^-1 = [1, sa tb, -ca tb; 0, ca, sa; 0, -sa/cb, ca/cb].
  const V inv = 1.0 / cb, tb = sb * inv;
  slot.Z.c[0] = R.c[0] + (sa * tb) * R.c[1] - (ca * tb) * R.c[2];
  slot.Z.c[1] = ca * R.c[1] + sa * R.c[2];
  slot.Z.c[2] = (ca * inv) * R.c[2] - (sa * inv) * R.c[1];
}

enum class Build { nominal, actual };

/// Frames along a chain from `f`; springs at rest in the nominal build.
template <Build B>
void walk(const Program& P, const ChainProgram& chain, const V* x, Frame& f, Scratch& s, std::int32_t only = -1) {
  for (int i = chain.first; i < chain.first + chain.count; ++i) {
    const Op& op = P.ops[i];
    apply(B == Build::nominal ? op.nominal : op.actual, f);
    switch (op.kind) {
      case OpKind::revolute:
      case OpKind::prismatic:
        move_joint(op, x[op.coordinate], f, s.joints[op.slot]);
        break;
      case OpKind::spring:
        if constexpr (B == Build::actual) move_spring(x + op.coordinate, f, s.stiff[op.slot]);
        break;
      case OpKind::block: {
        s.stiff[op.slot].start = f;
        for (int k = 0; k < op.count; ++k) {
          if (only >= 0 && i == P.legs_op && k != only) continue;
          Frame end = f;
          walk<B>(P, P.chains[op.first + k], x, end, s);
          s.branches[op.first + k].end = end;
        }
        f = s.branches[op.first].end;
        s.stiff[op.slot].p = f.p;
        break;
      }
      case OpKind::load:
        s.joints[op.slot].o = f.p;
        s.joints[op.slot].w = f.R * V3{splat(op.com[0]), splat(op.com[1]), splat(op.com[2])};
        break;
    }
  }
  apply(B == Build::nominal ? chain.nominal : chain.actual, f);
}

}  // namespace stiffmap::kernel
