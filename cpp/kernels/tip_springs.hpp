// SPDX-License-Identifier: MIT
// External springs at the tip: their wrench, and their energy's second derivatives (docs/fast_path.md F13). Lane by
// lane in plain numbers, apart from the other passes: machines without such springs keep their code and their bits.
#pragma once

#include "program.hpp"
#include "sym6.hpp"

namespace stiffmap::kernel {

/// Adds the wrench of all external springs about `point`, and their tangent there to K where one is given.
[[gnu::noinline]] inline void tip_springs(const Program& P, const Frame& tip, const V3& point, V6& wrench, Sym6* K) {
  const auto number = [](const V3& v, int c, int lane) { return c == 0 ? v.x[lane] : c == 1 ? v.y[lane] : v.z[lane]; };
  for (int i = 0; i < P.spring_count; ++i) {
    const TipSpringProgram& k = P.springs[i];
    for (int lane = 0; lane < W; ++lane) {
      double d[3], r[3], f[3], A[3][3], B[3][3];
      double square = 0;
      for (int c = 0; c < 3; ++c) {
        double q = number(tip.p, c, lane);
        for (int b = 0; b < 3; ++b) q += number(tip.R.c[b], c, lane) * k.offset[b];
        d[c] = q - k.anchor[c];
        r[c] = q - number(point, c, lane);
        square += d[c] * d[c];
      }
      const double length = __builtin_sqrt(square), force = k.stiffness * (length - k.length);
      if (length < 1e-12 || (k.tension_only && length <= k.length)) continue;
      // Along the spring its stiffness, across it the turning of its force.
      const double across = force / length;
      for (int a = 0; a < 3; ++a) {
        f[a] = -across * d[a];
        for (int b = 0; b < 3; ++b)
          A[a][b] = (k.stiffness - across) * (d[a] / length) * (d[b] / length) + (a == b ? across : 0.0);
      }
      wrench.a.x[lane] += f[0];
      wrench.a.y[lane] += f[1];
      wrench.a.z[lane] += f[2];
      wrench.b.x[lane] += r[1] * f[2] - r[2] * f[1];
      wrench.b.y[lane] += r[2] * f[0] - r[0] * f[2];
      wrench.b.z[lane] += r[0] * f[1] - r[1] * f[0];
      if (!K) continue;
      // Column c of B: A (e_c x r); E = (e_a x r)·(A (e_c x r)) - sym(r f^T) + (f·r) I.
      const double turned[3][3] = {{0, -r[2], r[1]}, {r[2], 0, -r[0]}, {-r[1], r[0], 0}};
      for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 3; ++c) {
          B[a][c] = 0;
          for (int b = 0; b < 3; ++b) B[a][c] += A[a][b] * turned[c][b];
        }
      const double along = f[0] * r[0] + f[1] * r[1] + f[2] * r[2];
      const auto E = [&](int a, int c) {
        double sum = a == c ? along : 0.0;
        for (int b = 0; b < 3; ++b) sum += turned[a][b] * B[b][c];
        return sum - 0.5 * (r[a] * f[c] + r[c] * f[a]);
      };
      K->A.xx[lane] += A[0][0];
      K->A.yy[lane] += A[1][1];
      K->A.zz[lane] += A[2][2];
      K->A.xy[lane] += A[0][1];
      K->A.xz[lane] += A[0][2];
      K->A.yz[lane] += A[1][2];
      for (int c = 0; c < 3; ++c) {
        K->B.c[c].x[lane] += B[0][c];
        K->B.c[c].y[lane] += B[1][c];
        K->B.c[c].z[lane] += B[2][c];
      }
      K->E.xx[lane] += E(0, 0);
      K->E.yy[lane] += E(1, 1);
      K->E.zz[lane] += E(2, 2);
      K->E.xy[lane] += E(0, 1);
      K->E.xz[lane] += E(0, 2);
      K->E.yz[lane] += E(1, 2);
    }
  }
}

}  // namespace stiffmap::kernel
