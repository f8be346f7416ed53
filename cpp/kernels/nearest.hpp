// SPDX-License-Identifier: MIT
// Newton's step of a leg with more joints than its end commands: the closed configuration nearest to home
// (docs/fast_path.md F25).
#pragma once

#include "normal_equations.hpp"

namespace stiffmap::kernel {

struct Nearest {
  static constexpr int most = 16;              // joints of a leg
  static constexpr double consistent = 1e-12;  // of the length: a row that repeats others asks for the same
  static constexpr double firm = 10;  // of the closure in the matrix of joints, which makes its pivots positive

  const Program& P;
  Scratch& s;
  const LegClosure& leg;
  V A[6][most];  ///< columns as lengths
  V missing[6];  ///< target less end
  V multiplier[6] = {}, step[most];
  V L[most][most], Y[most][7];  ///< matrix of joints; its solutions by the rows of A and by the right side

  Nearest(const Program& program, Scratch& scratch, const LegClosure& closure) : P(program), s(scratch), leg(closure) {}

  void place(const V6& error, const V3& end) {
    put(error, missing);
    const ClosureEquation& eq = P.equations[leg.first_equation];
    for (int t = 0; t < eq.count; ++t) {
      V c[6];
      put(NormalEquations::column(P, s, P.terms[eq.first + t], end), c);
      for (int i = 0; i < 6; ++i) A[i][t] = c[i];
    }
  }

  std::int32_t unknown(int t) const {
    return leg.first_unknown + P.terms[P.equations[leg.first_equation].first + t].unknown;
  }
  V3 linear(int t) const { return {A[0][t], A[1][t], A[2][t]}; }
  V3 angular(int t) const { return {A[3][t], A[4][t], A[5][t]}; }

  /// Multipliers alone, or with `curved` the step too, by the last multipliers; lanes where it leads to a minimum.
  M solve(bool curved) {
    const int n = leg.unknowns;
    const V3 force{multiplier[0], multiplier[1], multiplier[2]}, moment{multiplier[3], multiplier[4], multiplier[5]};
    for (int a = 0; a < n; ++a) {
      const std::int32_t u = unknown(a);
      const CoordinateProgram& k = P.coordinates[P.unknowns[u]];
      const V pull = P.nearness[u] * k.unit * (s.x[P.unknowns[u]] - k.home);
      V right = -pull;
      for (int i = 0; i < 6; ++i) {
        Y[a][i] = A[i][a];
        right += firm * A[i][a] * missing[i];
      }
      Y[a][6] = right;
      for (int b = 0; b <= a; ++b) {
        V v = splat(a == b ? P.nearness[u] : 0.0);
        for (int i = 0; i < 6; ++i) v += firm * A[i][a] * A[i][b];
        // b is nearer the base: its turn carries the other's column
        if (curved)
          v += (1 / P.length) *
               (dot(force, cross(angular(b), linear(a))) + 0.5 * dot(moment, cross(angular(b), angular(a))));
        L[a][b] = v;
      }
    }
    M dependent[most], sound = ~M{};
    factorise(L, n, dependent);
    for (int a = 0; a < n; ++a) sound &= ~dependent[a];
    for (int c = 0; c < 7; ++c) {
      for (int a = 0; a < n; ++a)
        for (int b = 0; b < a; ++b) Y[a][c] -= L[a][b] * Y[b][c];
      for (int a = 0; a < n; ++a) Y[a][c] *= 1.0 / L[a][a];
      for (int a = n - 1; a >= 0; --a)
        for (int b = a + 1; b < n; ++b) Y[a][c] -= L[b][a] * Y[b][c];
    }
    V S[6][most], m[6];
    for (int i = 0; i < 6; ++i) {
      m[i] = -missing[i];
      for (int a = 0; a < n; ++a) m[i] += A[i][a] * Y[a][6];
      for (int j = 0; j <= i; ++j) {
        S[i][j] = splat(0);
        for (int a = 0; a < n; ++a) S[i][j] += A[i][a] * Y[a][j];
      }
    }
    factorise(S, 6, dependent);
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < i; ++j) m[i] -= S[i][j] * m[j];
      sound &= ~dependent[i] | (absolute(m[i]) < consistent * P.length);
    }
    for (int i = 0; i < 6; ++i) m[i] *= 1.0 / S[i][i];
    for (int i = 5; i >= 0; --i)
      for (int j = i + 1; j < 6; ++j) m[i] -= S[j][i] * m[j];
    for (int i = 0; i < 6; ++i) multiplier[i] = m[i];
    for (int a = 0; a < n; ++a) {
      step[a] = Y[a][6];
      for (int i = 0; i < 6; ++i) step[a] -= Y[a][i] * m[i];
    }
    return sound;
  }

  /// L D Lᵀ below the diagonal, D on it. Lanes where an entry of D is not positive get an infinite one, so that the row
  /// counts for nothing: of S, a direction that those before leave no joint for (the end of a planar leg has three).
  static void factorise(V (*A)[most], int n, M* dependent) {
    for (int i = 0; i < n; ++i) {
      const V whole = A[i][i];
      for (int k = 0; k < i; ++k)
        for (int r = 0; r < k; ++r) A[i][k] -= A[i][r] * A[k][r];  // times the pivot, until the row is complete
      for (int k = 0; k < i; ++k) {
        const V v = A[i][k] / A[k][k];
        A[i][i] -= A[i][k] * v;
        A[i][k] = v;
      }
      dependent[i] = ~(A[i][i] > 1e-12 * whole);
      A[i][i] = select(dependent[i], splat(1e300), A[i][i]);
    }
  }

  V norm() const {
    V out = splat(0);
    for (int a = 0; a < leg.unknowns; ++a) out += step[a] * step[a];
    return root(out) * (1 / P.length);
  }

  void move(M lanes) {
    for (int a = 0; a < leg.unknowns; ++a) {
      const std::int32_t j = P.unknowns[unknown(a)];
      s.x[j] = select(lanes, s.x[j] + step[a] * (1 / P.coordinates[j].unit), s.x[j]);
    }
  }
};

}  // namespace stiffmap::kernel
