// SPDX-License-Identifier: MIT
// Angles from their sines and cosines, and rotations between two orientations.
#pragma once

#include "vectors.hpp"

namespace stiffmap::kernel {

/// atan2 to 2 ulp: the smaller over the larger, beyond tan(pi/8) reduced by pi/4, then Cephes' rational
/// approximation (Moshier, Methods and Programs for Mathematical Functions, 1989).
inline V arc_tangent(V y, V x) {
  constexpr double tan_pi_8 = 0.41421356237309503;
  constexpr double pi_2 = 1.57079632679489661923, pi_2_low = 6.12323399573676603587e-17;
  const V ay = absolute(y), ax = absolute(x);
  const M steep = ay > ax;
  const V large = select(steep, ay, ax), small = select(steep, ax, ay);
  const M middle = small > tan_pi_8 * large;
  const V up = select(middle, small - large, small), down = select(middle, small + large, large);
  const V t = up / select(down == 0.0, splat(1), down);
  const V z = t * t;
  const V p = -64.85021904942025371773 +
              z * (-122.8866684490136173410 +
                   z * (-75.00855792314704667340 + z * (-16.15753718733365076637 + z * -0.8750608600031904122785)));
  const V q = 194.5506571482613964425 +
              z * (485.3903996359136964868 +
                   z * (432.8810604912902668951 + z * (165.0270098316988542046 + z * (24.85846490142306297962 + z))));
  V a = t + t * z * (p / q);
  a = select(middle, a + 0.5 * pi_2_low + 0.5 * pi_2, a);
  a = select(steep, (pi_2 - a) + pi_2_low, a);
  a = select(x < 0.0, (2 * pi_2 - a) + 2 * pi_2_low, a);
  return select(y < 0.0, -a, a);
}

/// sin(angle) axis of the rotation that turns a into b, and its cosine.
inline V3 sine_between(const M3& a, const M3& b, V& cosine) {
  cosine = 0.5 * (dot(a.c[0], b.c[0]) + dot(a.c[1], b.c[1]) + dot(a.c[2], b.c[2]) - 1.0);
  return splat(0.5) * (cross(a.c[0], b.c[0]) + cross(a.c[1], b.c[1]) + cross(a.c[2], b.c[2]));
}

/// Rotation vector that turns a into b.
inline V3 rotation_between(const M3& a, const M3& b) {
  V c;
  const V3 n = sine_between(a, b, c);
  const V s2 = dot(n, n);
  // angle / sin(angle) = asin(s) / s: its series up to s = 0.1, the arc tangent beyond.
  V factor =
      1.0 + s2 * (1.0 / 6 +
                  s2 * (3.0 / 40 +
                        s2 * (5.0 / 112 +
                              s2 * (35.0 / 1152 + s2 * (63.0 / 2816 + s2 * (231.0 / 13312 + s2 * (143.0 / 10240)))))));
  const M near = (s2 < 0.01) & (c > 0.0);
  if (!all(near)) {
    const V s = root(s2);
    factor = select(near, factor, arc_tangent(s, c) / select(s == 0.0, splat(1), s));
  }
  return factor * n;
}

/// R turned by a rotation vector in the frame in which R's columns are given.
inline M3 turned_by(const M3& R, const V3& by) {
  const V angle = root(dot(by, by));
  const V safe = select(angle > 0.0, angle, splat(1));
  V sn, cs;
  sincos(angle, sn, cs);
  const V3 u = (1.0 / safe) * by;
  M3 out;
  for (int k = 0; k < 3; ++k) {
    const V3 w = R.c[k];
    out.c[k] = cs * w + sn * cross(u, w) + ((1.0 - cs) * dot(u, w)) * u;
  }
  return out;
}

/// Twist from frame a to frame b.
inline V6 frame_error(const Frame& a, const Frame& b) { return {b.p - a.p, rotation_between(a.R, b.R)}; }

}  // namespace stiffmap::kernel
