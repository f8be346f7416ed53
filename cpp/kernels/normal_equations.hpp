// SPDX-License-Identifier: MIT
// Gauss-Newton step of one leg's closure by its normal equations, which are zero outside an envelope.
#pragma once

#include "slots.hpp"
#include "starts.hpp"
#include "tip_task.hpp"

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

  V squares;                  ///< of the errors
  const std::int32_t* first;  ///< of each row: the first entry that may differ from zero

  /// N = J^T J and g = -J^T e at the frames where the errors were found.
  void assemble(const Program& P, const Scratch& s, const LegClosure& leg, const V6* errors, const M3& target) {
    squares = splat(0);
    first = P.envelope + leg.first_unknown;
    for (int i = 0; i < leg.unknowns; ++i) {
      g[i] = splat(0);
      for (int k = first[i]; k <= i; ++k) at(i, k) = splat(0);
    }
    for (int q = 0; q < leg.equations; ++q) {
      const ClosureEquation& eq = P.equations[leg.first_equation + q];
      const V3 p = s.branches[eq.chain].end.p;
      V6 columns[2 * most_unknowns];
      squares += dot(errors[q], errors[q]);
      const bool part = eq.primary < 0 && P.open_task;
      const TipTask task(P, s.branches[eq.chain].end.R, target);
      for (int t = 0; t < eq.count; ++t) {
        columns[t] = column(P, s, P.terms[eq.first + t], p);
        if (part) columns[t] = task.column(columns[t]);
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
    for (int i = 0; i < n; ++i) {
      V d = at(i, i);
      for (int k = first[i]; k < i; ++k) {
        V v = at(i, k);
        for (int r = first[i] > first[k] ? first[i] : first[k]; r < k; ++r) v -= at(i, r) * at(k, r);
        at(i, k) = v;  // times the pivot, until the row is complete
      }
      for (int k = first[i]; k < i; ++k) {
        const V v = at(i, k) * inverse[k];
        d -= at(i, k) * v;
        at(i, k) = v;
      }
      inverse[i] = 1.0 / d;
    }
    V left = squares;
    for (int i = 0; i < n; ++i) {
      for (int k = first[i]; k < i; ++k) g[i] -= at(i, k) * g[k];
      left -= g[i] * g[i] * inverse[i];
    }
    for (int i = 0; i < n; ++i) g[i] *= inverse[i];
    for (int i = n - 1; i > 0; --i)
      for (int k = first[i]; k < i; ++k) g[k] -= at(i, k) * g[i];
    return left;
  }

  /// Damping of Levenberg and Marquardt.
  void damp(int n, V mu) {
    for (int i = 0; i < n; ++i) at(i, i) += mu;
  }
};

}  // namespace stiffmap::kernel
