// SPDX-License-Identifier: MIT
// Straight springs and cables at the tip: wrench, energy, and the energy's second derivatives (docs/fast_path.md F15).
// Apart from the other passes: machines without them keep their code and their bits.
#pragma once

#include "slots.hpp"

namespace stiffmap::kernel {

inline V3 lanes_of(const double* x) { return V3{splat(x[0]), splat(x[1]), splat(x[2])}; }

/// The way of a cable over its guide to a point d from where it enters (theory B2).
struct Line {
  V length;
  V3 along;  ///< its gradient by the point
  V bend;    ///< its second derivative: in the plane of the pulley (across `along`), and across that plane
  V bend_out;
  V3 in_plane, out;
};

/// Angle of the vector (x, y) from the first axis, lane by lane.
inline V angle_of(V x, V y) {
  V out{};
  for (int i = 0; i < W; ++i) out[i] = __builtin_atan2(y[i], x[i]);
  return out;
}

inline Line line_to(const TipSpringProgram& k, const V3& d) {
  Line out{};
  if (k.radius == 0) {
    out.length = root(dot(d, d));
    const M some = ~(out.length < 1e-12);
    const V inverse = select(some, 1.0 / out.length, splat(0));
    out.along = inverse * d;
    out.bend = inverse;
    return out;
  }
  const V3 axis = lanes_of(k.axis);
  const V height = dot(d, axis);
  const V3 across = d - height * axis;
  const V out_of_axis = root(dot(across, across)), in_plane = out_of_axis - k.radius;
  const V3 e = (1.0 / out_of_axis) * across;
  const V straight = root(in_plane * in_plane + height * height - k.radius * k.radius);
  // The direction of the straight piece in the plane: that of (in_plane, height), turned by the tangent's angle.
  const V inverse = 1.0 / (in_plane * in_plane + height * height);
  const V s = (in_plane * straight + k.radius * height) * inverse,
          c = (height * straight - k.radius * in_plane) * inverse;
  out.length = k.radius * angle_of(c, s) + straight;
  out.along = s * e + c * axis;
  out.in_plane = c * e - s * axis;
  out.out = cross(axis, e);
  out.bend = 1.0 / straight;
  out.bend_out = s / out_of_axis;
  return out;
}

/// Free length of an element: of a cable where its winch stands.
inline V free_length(const TipSpringProgram& k, const Scratch& s) {
  return k.coordinate < 0 ? splat(k.length) : s.x[k.coordinate];
}

/// The free length that the controller commands for the tip's pose (theory B3).
inline void wind(const Program& P, const Frame& command, Scratch& s) {
  for (int i = 0; i < P.spring_count; ++i) {
    const TipSpringProgram& k = P.springs[i];
    if (k.coordinate < 0) continue;
    const Line line = line_to(k, command.p + command.R * lanes_of(k.nominal_offset) - lanes_of(k.nominal_anchor));
    s.x[k.coordinate] = (line.length - k.stretch) * k.slope;
  }
}

/// Adds the tangent at `arm` of a force f that changes by -A times the motion of its point.
inline void add_at_arm(Sym6& K, const S3& A, const V3& r, const V3& f) {
  const V none = splat(0);
  const V3 turned[3] = {{none, -r.z, r.y}, {r.z, none, -r.x}, {-r.y, r.x, none}};  // unit rotations times the arm
  V3 B[3];
  for (int k = 0; k < 3; ++k) B[k] = A * turned[k];
  K.A = K.A + A;
  for (int k = 0; k < 3; ++k) K.B.c[k] = K.B.c[k] + B[k];
  K.E.xx += dot(turned[0], B[0]);
  K.E.yy += dot(turned[1], B[1]);
  K.E.zz += dot(turned[2], B[2]);
  K.E.xy += dot(turned[0], B[1]);
  K.E.xz += dot(turned[0], B[2]);
  K.E.yz += dot(turned[1], B[2]);
  add_lever(K.E, splat(-1), f, r);
}

inline void add_square(S3& A, V s, const V3& u) {
  const V3 a = s * u;
  A = A + S3{a.x * u.x, a.y * u.y, a.z * u.z, a.x * u.y, a.x * u.z, a.y * u.z};
}

/// Adds the wrench of all elements about `point`; their tangent there to K, their energy to `energy`, where given.
/// What a winch holds goes to its coordinate's reaction.
[[gnu::noinline]] inline void pull_at_tip(const Program& P, Scratch& s, const Frame& tip, const V3& point, V6& wrench,
                                          Sym6* K, V* energy = nullptr) {
  for (int i = 0; i < P.spring_count; ++i) {
    const TipSpringProgram& k = P.springs[i];
    const V3 q = tip.p + tip.R * lanes_of(k.offset), r = q - point;
    const Line line = line_to(k, q - lanes_of(k.anchor));
    const V rest = free_length(k, s), stretch = line.length - rest;
    M yields = ~(line.length < 1e-12), pulls = yields;
    if (k.tension_only) {
      yields &= stretch > -1e-12 * line.length;
      pulls &= stretch > 0.0;
    }
    const V stiffness = k.coordinate < 0 ? splat(k.stiffness) : 1.0 / (k.fixed + k.per_length * larger(rest, splat(0)));
    const V T = select(pulls, stiffness * stretch, splat(0)), along = select(yields, stiffness, splat(0));
    if (k.coordinate >= 0) s.tau[k.coordinate] = T;
    const V3 f = -T * line.along;
    wrench = wrench + V6{f, cross(r, f)};
    if (energy) *energy += select(pulls, 0.5 * T * stretch, splat(0));
    if (!K) continue;
    S3 A{};
    if (k.radius == 0) {  // across the line in every direction alike
      const V across = T * line.bend;
      add_square(A, along - across, line.along);
      A.xx += across;
      A.yy += across;
      A.zz += across;
    } else {
      add_square(A, along, line.along);
      add_square(A, T * line.bend, line.in_plane);
      add_square(A, T * line.bend_out, line.out);
    }
    add_at_arm(*K, A, r, f);
  }
}

}  // namespace stiffmap::kernel
