// SPDX-License-Identifier: MIT
// Starts of the closure from the grid of closed configurations: cubic interpolation, or the nearest node.
#pragma once

#include "slots.hpp"

namespace stiffmap::kernel {

inline constexpr int most_unknowns = 48;  // of a leg
inline constexpr int most_closure_unknowns = 192;

struct Starts {
  const Program& P;

  /// Neighbouring nodes along one axis and their shares.
  struct Stencil {
    std::int64_t first;
    double share[4] = {};
  };

  /// Lagrange's weights on `points` (1, 2 or 4) nodes around p; false outside the grid. An axis along which the
  /// workspace is flat has one node.
  bool stencil(int axis, double p, int points, Stencil& out) const {
    const int n = P.grid_n[axis];
    const double u = (p - P.grid_low[axis]) / P.grid_step[axis];
    if (n == 1) {
      out = {0, {1}};
      return u >= -0.5 && u <= 0.5;
    }
    if (!(u >= -1e-9 && u <= n - 1 + 1e-9)) return false;
    int i = static_cast<int>(u) - (points == 4 ? 1 : 0);
    i = i < 0 ? 0 : i > n - points ? n - points : i;
    out.first = i;
    const double t = u - i;
    if (points == 2) {
      out.share[0] = 1 - t;
      out.share[1] = t;
    } else {
      out.share[0] = (t - 1) * (t - 2) * (t - 3) * (-1.0 / 6);
      out.share[1] = t * (t - 2) * (t - 3) * 0.5;
      out.share[2] = t * (t - 1) * (t - 3) * -0.5;
      out.share[3] = t * (t - 1) * (t - 2) * (1.0 / 6);
    }
    return true;
  }

  static int points(int nodes, bool cubic) { return cubic && nodes >= 4 ? 4 : nodes > 1 ? 2 : 1; }

  /// Row of unknowns at p: cubic, linear next to a node out of reach; false where that is one too.
  bool interpolate(const double* p, double* row) const {
    return interpolate(p, true, row) || interpolate(p, false, row);
  }

  bool interpolate(const double* p, bool cubic, double* row) const {
    const int nx = points(P.grid_n[0], cubic), ny = points(P.grid_n[1], cubic), nz = points(P.grid_n[2], cubic);
    Stencil x, y, z;
    if (!stencil(0, p[0], nx, x) || !stencil(1, p[1], ny, y) || !stencil(2, p[2], nz, z)) return false;
    return nx == 4 && ny == 4 && nz == 4 ? sum<true>(x, y, z, 4, 4, 4, row) : sum<false>(x, y, z, nx, ny, nz, row);
  }

  /// Sum over a stencil; all of 4x4x4 nodes, or of so many.
  template <bool All>
  bool sum(const Stencil& x, const Stencil& y, const Stencil& z, int nx, int ny, int nz, double* row) const {
    if constexpr (All) nx = ny = nz = 4;
    const std::int64_t dx = P.grid_n[0] > 1 ? P.grid_row : 0, dy = std::int64_t{P.grid_row} * P.grid_n[0],
                       dz = dy * P.grid_n[1];
    const double* corner = P.grid + x.first * dx + y.first * dy + z.first * dz;
    V doubtful = splat(0);
    for (int j = 0; j < P.grid_row; j += W) {
      V whole = splat(0);
      for (int k = 0; k < nz; ++k) {
        V plane = splat(0);
        for (int i = 0; i < ny; ++i) {
          const double* g = corner + k * dz + i * dy + j;
          V line = x.share[0] * load(g) + x.share[1] * load(g + dx);
          if (nx == 4) line += x.share[2] * load(g + 2 * dx) + x.share[3] * load(g + 3 * dx);
          plane += y.share[i] * line;
        }
        whole += z.share[k] * plane;
      }
      doubtful += whole;
      __builtin_memcpy(row + j, &whole, sizeof whole);
    }
    return !any(doubtful != doubtful);
  }

  /// The nearest node within reach (of the face of the grid for a point outside): its row of unknowns and its
  /// position; null: none.
  const double* nearest(const double* p, double (&at)[3]) const {
    Stencil axis[3];
    for (int k = 0; k < 3; ++k) {
      const double high = P.grid_low[k] + (P.grid_n[k] - 1) * P.grid_step[k];
      const double inside = p[k] < P.grid_low[k] ? P.grid_low[k] : p[k] > high ? high : p[k];
      if (!stencil(k, inside, 2, axis[k])) return nullptr;
    }
    const std::int64_t stride[3] = {1, P.grid_n[0], static_cast<std::int64_t>(P.grid_n[0]) * P.grid_n[1]};
    if (P.grid_row == 0) return nullptr;
    double best = 1e300;
    const double* found = nullptr;
    for (int corner = 0; corner < 8; ++corner) {
      std::int64_t node = 0;
      double distance = 0, here[3];
      for (int k = 0; k < 3; ++k) {
        const std::int64_t i = axis[k].first + (P.grid_n[k] > 1 ? corner >> k & 1 : 0);
        node += i * stride[k];
        here[k] = P.grid_low[k] + static_cast<double>(i) * P.grid_step[k];
        distance += (p[k] - here[k]) * (p[k] - here[k]);
      }
      const double* row = P.grid + node * P.grid_row;
      if (distance >= best || row[0] != row[0]) continue;
      best = distance;
      found = row;
      for (int k = 0; k < 3; ++k) at[k] = here[k];
    }
    return found;
  }
};

}  // namespace stiffmap::kernel
