// SPDX-License-Identifier: MIT
// Gauss-Newton step of one leg's closure by its normal equations.
#pragma once

#include "slots.hpp"
#include "starts.hpp"

namespace stiffmap::kernel {

struct NormalEquations {
  V N[most_unknowns * (most_unknowns + 1) / 2];  ///< lower part, row by row
  V g[most_unknowns];                            ///< right-hand side, then the step; angles as lengths

  V& at(int i, int k) { return N[i * (i + 1) / 2 + k]; }

  static V6 column(const Program& P, const Scratch& s, const ClosureTerm& t, const V3& p) {
    const JointSlot& j = s.joints[t.slot];
    if (t.prismatic) return {splat(t.sign) * j.w, V3{}};
    return {splat(t.sign / P.length) * cross(j.w, p - j.o), splat(t.sign) * j.w};
  }

  V squares;  ///< of the errors

  /// N = J^T J and g = -J^T e at the frames where the errors were found.
  void assemble(const Program& P, const Scratch& s, const LegClosure& leg, const V6* errors) {
    squares = splat(0);
    for (int i = 0; i < leg.unknowns; ++i) {
      g[i] = splat(0);
      for (int k = 0; k <= i; ++k) at(i, k) = splat(0);
    }
    for (int q = 0; q < leg.equations; ++q) {
      const ClosureEquation& eq = P.equations[leg.first_equation + q];
      const V3 p = s.branches[eq.chain].end.p;
      V6 columns[2 * most_unknowns];
      squares += dot(errors[q], errors[q]);
      for (int t = 0; t < eq.count; ++t) {
        columns[t] = column(P, s, P.terms[eq.first + t], p);
        const int i = P.terms[eq.first + t].unknown;
        g[i] += dot(columns[t], errors[q]);
        for (int r = 0; r <= t; ++r) {
          const int k = P.terms[eq.first + r].unknown;
          const V product = dot(columns[t], columns[r]);
          (i >= k ? at(i, k) : at(k, i)) += i == k && r != t ? product + product : product;
        }
      }
    }
  }

  /// Leaves the step in g; returns the square of what it can not make good.
  V solve(int n) {
    V inverse[most_unknowns];
    for (int j = 0; j < n; ++j) {
      V w[most_unknowns], d = at(j, j);
      for (int k = 0; k < j; ++k) {
        w[k] = at(j, k) * at(k, k);
        d -= at(j, k) * w[k];
      }
      at(j, j) = d;
      inverse[j] = 1.0 / d;
      for (int i = j + 1; i < n; ++i) {
        V v = at(i, j);
        for (int k = 0; k < j; ++k) v -= at(i, k) * w[k];
        at(i, j) = v * inverse[j];
      }
    }
    V left = squares;
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < i; ++k) g[i] -= at(i, k) * g[k];
      left -= g[i] * g[i] * inverse[i];
    }
    for (int i = 0; i < n; ++i) g[i] *= inverse[i];
    for (int i = n - 2; i >= 0; --i)
      for (int k = i + 1; k < n; ++k) g[i] -= at(k, i) * g[k];
    return left;
  }
};

}  // namespace stiffmap::kernel
