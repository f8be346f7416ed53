// SPDX-License-Identifier: MIT
// Closure of each leg in lanes: Gauss-Newton on the normal equations from an interpolated start, with
// the same trust test as the reference closure. A lane that fails it is left to the reference path.
#pragma once

#include "frames.hpp"

namespace stiffmap::kernel {

inline constexpr int most_unknowns = 24;
inline constexpr int most_closure_unknowns = 8 * most_unknowns;
inline constexpr int most_closure_steps = 12;
inline constexpr int leaps = 8;
inline constexpr double trusted_step = 0.25;  // first Gauss-Newton step, relative to the length

struct Closing {
  const Program& P;
  Scratch& s;

  struct Cell {
    std::int64_t base;
    std::int64_t stride[3];
    double w[3];
    bool inside;
  };

  Cell cell(const double* p) const {
    Cell c{0, {1, P.grid_n[0], static_cast<std::int64_t>(P.grid_n[0]) * P.grid_n[1]}, {}, true};
    for (int k = 0; k < 3; ++k) {
      const double u = (p[k] - P.grid_low[k]) / P.grid_step[k];
      if (!(u >= -1e-9 && u <= P.grid_n[k] - 1 + 1e-9)) return c.inside = false, c;
      int i = static_cast<int>(u);
      i = i < 0 ? 0 : i > P.grid_n[k] - 2 ? P.grid_n[k] - 2 : i;
      c.w[k] = u - i;
      c.base += i * c.stride[k];
    }
    return c;
  }

  bool put_start(const double* x, int lane) {
    bool finite = true;
    for (int j = 0; j < P.unknown_count; ++j) {
      finite = finite && x[j] == x[j];
      s.x[P.unknowns[j]][lane] = x[j];
    }
    return finite;
  }

  /// Start coordinates of one pose by trilinear interpolation, NaN next to a node that is out of
  /// reach; false outside the grid.
  bool interpolate(const double* p, int lane) {
    const Cell c = cell(p);
    if (!c.inside) return false;
    double x[most_closure_unknowns] = {};
    for (int corner = 0; corner < 8; ++corner) {
      std::int64_t node = c.base;
      double share = 1;
      for (int k = 0; k < 3; ++k) {
        const bool up = corner >> k & 1;
        node += up ? c.stride[k] : 0;
        share *= up ? c.w[k] : 1 - c.w[k];
      }
      const double* g = P.grid + node * P.unknown_count;
      for (int j = 0; j < P.unknown_count; ++j) x[j] += share * g[j];
    }
    put_start(x, lane);
    return true;
  }

  /// Start coordinates and position of the nearest node within reach.
  bool nearest(const double* p, int lane, V3& at) {
    const Cell c = cell(p);
    if (!c.inside) return false;
    double best = 1e300;
    std::int64_t found = -1;
    for (int corner = 0; corner < 8; ++corner) {
      std::int64_t node = c.base;
      double distance = 0;
      for (int k = 0; k < 3; ++k) {
        const bool up = corner >> k & 1;
        node += up ? c.stride[k] : 0;
        const double d = (up ? 1 - c.w[k] : c.w[k]) * P.grid_step[k];
        distance += d * d;
      }
      const double first = P.grid[node * P.unknown_count];
      if (distance >= best || first != first) continue;
      best = distance;
      found = node;
    }
    if (found < 0) return false;
    std::int64_t left = found;
    double q[3];
    for (int k = 0; k < 3; ++k) {
      q[k] = P.grid_low[k] + static_cast<double>(left % P.grid_n[k]) * P.grid_step[k];
      left /= P.grid_n[k];
    }
    at.x[lane] = q[0];
    at.y[lane] = q[1];
    at.z[lane] = q[2];
    return put_start(P.grid + found * P.unknown_count, lane);
  }

  /// Closes the legs of the usable lanes to `tip`; returns the lanes that closed, coordinates in s.x.
  /// Where the interpolated start was too far, the nearest node is continued in short leaps.
  M close(const Frame& tip, M usable, const std::int64_t* pose, const double* position) {
    M ok = reach(tip, usable);
    const M left = usable & ~ok;
    if (!any(left)) return ok;
    V3 from = tip.p;
    M moving = left;
    for (int i = 0; i < W; ++i)
      if (left[i] && !nearest(position + 3 * pose[i], i, from)) moving[i] = 0;
    for (int leap = 1; leap <= leaps && any(moving); ++leap) {
      const Frame way{from + splat(static_cast<double>(leap) / leaps) * (tip.p - from), tip.R};
      moving &= reach(leap == leaps ? tip : way, moving);
    }
    return ok | moving;
  }

  M reach(const Frame& tip, M usable) {
    M ok = usable;
    const Op& block = P.ops[P.legs_op];
    Frame before = base_frame(), after = tip;
    const ChainProgram& root = P.chains[P.root];
    // The legs end where the platform's constant transforms begin.
    undo(root.nominal, after);
    for (int i = root.first + root.count - 1; i > P.legs_op; --i) undo(P.ops[i].nominal, after);
    for (int i = root.first; i <= P.legs_op; ++i) apply(P.ops[i].nominal, before);
    for (int k = 0; k < block.count; ++k) ok &= close_leg(P.legs[k], block.first + k, before, after, ok);
    return ok;
  }

  static Frame base_frame() {
    const V o = splat(0), l = splat(1);
    return {{o, o, o}, {{{l, o, o}, {o, l, o}, {o, o, l}}}};
  }

  static void undo(const Constant& T, Frame& f) {
    if (T.has_rotation) {
      const M3 R = f.R;
      for (int i = 0; i < 3; ++i) {
        V3 column{splat(0), splat(0), splat(0)};
        for (int k = 0; k < 3; ++k) column = column + splat(T.R[3 * k + i]) * R.c[k];
        f.R.c[i] = column;
      }
    }
    if (T.has_translation) f.p = f.p - f.R * V3{splat(T.p[0]), splat(T.p[1]), splat(T.p[2])};
  }

  V6 column(const ClosureTerm& t, const V3& p) const {
    const JointSlot& j = s.joints[t.slot];
    if (t.prismatic) return {splat(t.sign) * j.w, V3{}};
    return {splat(t.sign / P.length) * cross(j.w, p - j.o), splat(t.sign) * j.w};
  }

  M close_leg(const LegClosure& leg, int chain, const Frame& start, const Frame& target, M usable) {
    const int n = leg.unknowns;
    const std::int32_t* unknown = P.unknowns + leg.first_unknown;
    M done{}, failed = ~usable;
    V previous = splat(0);
    for (int step = 0; step < most_closure_steps; ++step) {
      V N[most_unknowns][most_unknowns], g[most_unknowns];
      V6 errors[most_unknowns];
      const V error = closure_errors(leg, chain, start, target, errors);
      if (step > 0) done |= ~failed & (error < 1e-12) & (previous < 1e-7);
      if (all(done | failed)) break;
      normal_equations(leg, errors, N, g);
      solve(n, N, g);
      V norm = splat(0);
      for (int k = 0; k < n; ++k) norm += g[k] * g[k];
      norm = root(norm) * (1 / P.length);
      failed |= ~done & ~(norm < trusted_step);
      if (step > 0) failed |= ~done & ~((norm <= 0.25 * previous) | (norm < 1e-9));
      const M active = ~done & ~failed;
      for (int k = 0; k < n; ++k) {
        V& x = s.x[unknown[k]];
        x = select(active, x + g[k] * (1 / P.coordinates[unknown[k]].unit), x);
      }
      previous = select(active, norm, previous);
    }
    return done;
  }

  /// Twists that are missing at each closure, angles as lengths; returns the largest over the length.
  V closure_errors(const LegClosure& leg, int chain, const Frame& start, const Frame& target, V6* errors) {
    Frame end = start;
    walk<Build::nominal>(P, P.chains[chain], s.x, end, s);
    s.branches[chain].end = end;
    V worst = splat(0);
    for (int q = 0; q < leg.equations; ++q) {
      const ClosureEquation& eq = P.equations[leg.first_equation + q];
      const Frame& b = s.branches[eq.chain].end;
      V6& e = errors[q];
      e = eq.primary < 0 ? frame_error(b, target) : frame_error(b, s.branches[eq.primary].end);
      e.b = splat(P.length) * e.b;
      worst = larger(worst, larger(larger(absolute(e.a.x), absolute(e.a.y)), absolute(e.a.z)));
      worst = larger(worst, larger(larger(absolute(e.b.x), absolute(e.b.y)), absolute(e.b.z)));
    }
    return worst * (1 / P.length);
  }

  /// N = J^T J and g = -J^T e at the frames of closure_errors.
  void normal_equations(const LegClosure& leg, const V6* errors, V (&N)[most_unknowns][most_unknowns],
                        V (&g)[most_unknowns]) const {
    for (int i = 0; i < leg.unknowns; ++i) {
      g[i] = splat(0);
      for (int k = 0; k <= i; ++k) N[i][k] = splat(0);
    }
    for (int q = 0; q < leg.equations; ++q) {
      const ClosureEquation& eq = P.equations[leg.first_equation + q];
      const V3 p = s.branches[eq.chain].end.p;
      V6 columns[2 * most_unknowns];
      for (int t = 0; t < eq.count; ++t) {
        columns[t] = column(P.terms[eq.first + t], p);
        const int i = P.terms[eq.first + t].unknown;
        g[i] += dot(columns[t], errors[q]);
        for (int r = 0; r <= t; ++r) {
          const int k = P.terms[eq.first + r].unknown;
          const V product = dot(columns[t], columns[r]);
          (i >= k ? N[i][k] : N[k][i]) += i == k && r != t ? product + product : product;
        }
      }
    }
  }

  static void solve(int n, V (&N)[most_unknowns][most_unknowns], V (&g)[most_unknowns]) {
    V inverse[most_unknowns];
    for (int j = 0; j < n; ++j) {
      V d = N[j][j];
      for (int k = 0; k < j; ++k) d -= N[j][k] * N[j][k] * N[k][k];
      N[j][j] = d;
      inverse[j] = 1.0 / d;
      for (int i = j + 1; i < n; ++i) {
        V v = N[i][j];
        for (int k = 0; k < j; ++k) v -= N[i][k] * N[j][k] * N[k][k];
        N[i][j] = v * inverse[j];
      }
    }
    for (int i = 1; i < n; ++i)
      for (int k = 0; k < i; ++k) g[i] -= N[i][k] * g[k];
    for (int i = 0; i < n; ++i) g[i] *= inverse[i];
    for (int i = n - 2; i >= 0; --i)
      for (int k = i + 1; k < n; ++k) g[i] -= N[k][i] * g[k];
  }
};

}  // namespace stiffmap::kernel
