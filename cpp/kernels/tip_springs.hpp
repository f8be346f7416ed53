// SPDX-License-Identifier: MIT
// External springs at the tip: their wrench, and their energy's second derivatives (docs/fast_path.md F15). Apart from
// the other passes: machines without such springs keep their code and their bits.
#pragma once

#include "program.hpp"
#include "sym6.hpp"

namespace stiffmap::kernel {

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

/// Adds the wrench of all external springs about `point`, and their tangent there to K where one is given.
[[gnu::noinline]] inline void tip_springs(const Program& P, const Frame& tip, const V3& point, V6& wrench, Sym6* K) {
  const auto lanes = [](const double* x) { return V3{splat(x[0]), splat(x[1]), splat(x[2])}; };
  for (int i = 0; i < P.spring_count; ++i) {
    const TipSpringProgram& k = P.springs[i];
    const V3 q = tip.p + tip.R * lanes(k.offset), d = q - lanes(k.anchor), r = q - point;
    const V length = root(dot(d, d));
    M pulls = ~(length < 1e-12);
    if (k.tension_only) pulls &= length > k.length;
    // Along the spring its stiffness, across it the turning of its force.
    const V inverse = select(pulls, 1.0 / length, splat(0));
    const V across = k.stiffness * (length - k.length) * inverse, along = select(pulls, k.stiffness - across, splat(0));
    const V3 f = -across * d, u = inverse * d, a = along * u;
    wrench = wrench + V6{f, cross(r, f)};
    if (!K) continue;
    const S3 A{a.x * u.x + across, a.y * u.y + across, a.z * u.z + across, a.x * u.y, a.x * u.z, a.y * u.z};
    add_at_arm(*K, A, r, f);
  }
}

}  // namespace stiffmap::kernel
