// SPDX-License-Identifier: MIT
// Closure of each leg in lanes: Gauss-Newton on the normal equations from an interpolated start, with
// the same trust test as the reference closure. A lane that fails it is left to the reference path.
#pragma once

#include "frames.hpp"

namespace stiffmap::kernel {

inline constexpr int most_unknowns = 24;
inline constexpr int most_closure_steps = 12;

struct Closing {
  const Program& P;
  Scratch& s;

  /// Start coordinates of one pose by trilinear interpolation; false outside the grid or next to a
  /// node that is out of reach.
  bool start(const double* p, int lane) {
    double w[3];
    std::int64_t base = 0, stride[3] = {1, P.grid_n[0], static_cast<std::int64_t>(P.grid_n[0]) * P.grid_n[1]};
    for (int k = 0; k < 3; ++k) {
      const double u = (p[k] - P.grid_low[k]) / P.grid_step[k];
      if (!(u >= -1e-9 && u <= P.grid_n[k] - 1 + 1e-9)) return false;
      int i = static_cast<int>(u);
      i = i < 0 ? 0 : i > P.grid_n[k] - 2 ? P.grid_n[k] - 2 : i;
      w[k] = u - i;
      base += i * stride[k];
    }
    double x[8 * most_unknowns] = {};
    for (int c = 0; c < 8; ++c) {
      std::int64_t node = base;
      double share = 1;
      for (int k = 0; k < 3; ++k) {
        node += (c >> k & 1) * stride[k];
        share *= c >> k & 1 ? w[k] : 1 - w[k];
      }
      const double* g = P.grid + node * P.unknown_count;
      for (int j = 0; j < P.unknown_count; ++j) x[j] += share * g[j];
    }
    bool finite = true;
    for (int j = 0; j < P.unknown_count; ++j) {
      finite = finite && x[j] == x[j];
      s.x[P.unknowns[j]][lane] = x[j];
    }
    return finite;
  }

  /// Closes all legs to `tip`; returns the lanes that closed. Leaves coordinates in s.x.
  M close(const Frame& tip) {
    M ok = splat(0) == splat(0);
    const Op& block = P.ops[P.legs_op];
    Frame before = base_frame(), after = tip;
    const ChainProgram& root = P.chains[P.root];
    // The legs end where the platform's constant transforms begin.
    undo(root.nominal, after);
    for (int i = root.first + root.count - 1; i > P.legs_op; --i) undo(P.ops[i].nominal, after);
    for (int i = root.first; i <= P.legs_op; ++i) apply(P.ops[i].nominal, before);
    for (int k = 0; k < block.count; ++k) ok &= close_leg(P.legs[k], block.first + k, before, after);
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

  M close_leg(const LegClosure& leg, int chain, const Frame& start, const Frame& target) {
    const int n = leg.unknowns;
    const std::int32_t* unknown = P.unknowns + leg.first_unknown;
    M done = splat(0) != splat(0), failed = done;
    V previous = splat(0);
    for (int step = 0; step < most_closure_steps; ++step) {
      V N[most_unknowns][most_unknowns], g[most_unknowns];
      const V error = normal_equations(leg, chain, start, target, N, g);
      if (step > 0) done |= ~failed & (error < 1e-12) & (previous < 1e-7);
      if (all(done | failed)) break;
      solve(n, N, g);
      V norm = splat(0);
      for (int k = 0; k < n; ++k) norm += g[k] * g[k];
      norm = root(norm) * (1 / P.length);
      failed |= ~done & ~(norm < 0.1);
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

  /// N = J^T J and g = -J^T e with angles as lengths; returns the largest error over the length.
  V normal_equations(const LegClosure& leg, int chain, const Frame& start, const Frame& target,
                     V (&N)[most_unknowns][most_unknowns], V (&g)[most_unknowns]) {
    Frame end = start;
    walk<Build::nominal>(P, P.chains[chain], s.x, end, s);
    s.branches[chain].end = end;
    const int n = leg.unknowns;
    for (int i = 0; i < n; ++i) {
      g[i] = splat(0);
      for (int k = 0; k <= i; ++k) N[i][k] = splat(0);
    }
    V worst = splat(0);
    for (int q = leg.first_equation; q < leg.first_equation + leg.equations; ++q) {
      const ClosureEquation& eq = P.equations[q];
      const Frame& b = s.branches[eq.chain].end;
      V6 e = eq.primary < 0 ? frame_error(b, target) : frame_error(b, s.branches[eq.primary].end);
      e.b = splat(P.length) * e.b;
      worst = larger(worst, larger(larger(absolute(e.a.x), absolute(e.a.y)), absolute(e.a.z)));
      worst = larger(worst, larger(larger(absolute(e.b.x), absolute(e.b.y)), absolute(e.b.z)));
      V6 columns[most_unknowns];
      for (int t = 0; t < eq.count; ++t) columns[t] = column(P.terms[eq.first + t], b.p);
      for (int t = 0; t < eq.count; ++t) {
        const int i = P.terms[eq.first + t].unknown;
        g[i] += dot(columns[t], e);
        for (int r = 0; r <= t; ++r) {
          const int k = P.terms[eq.first + r].unknown;
          (i >= k ? N[i][k] : N[k][i]) += dot(columns[t], columns[r]);
        }
      }
    }
    return worst * (1 / P.length);
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
