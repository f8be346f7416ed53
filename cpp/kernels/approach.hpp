// SPDX-License-Identifier: MIT
// Whether a leg can reach its target at all: damped descent of the closure error (Levenberg 1944, Marquardt 1963).
// Where the error settles away from zero, the target is taken to be out of reach; where it does not
// settle, or nearly vanishes, nothing is said and the reference path decides.
#pragma once

#include "frames.hpp"
#include "normal_equations.hpp"

namespace stiffmap::kernel {

struct Approach {
  const Program& P;
  Scratch& s;

  static constexpr int steps = 64, settling = 8;
  static constexpr double settled = 0.02;   // largest relative fall of the squared error in `settling` steps
  static constexpr double touching = 1e-4;  // error relative to the length: next to the border, the reference decides

  /// Lanes of `lanes` whose error settles away from zero. `closing` evaluates errors.
  template <class Closing>
  M stays_away(Closing& closing, const LegClosure& leg, int chain, const Frame& start, const Frame& target, M lanes) {
    const std::int32_t* unknown = P.unknowns + leg.first_unknown;
    V6 errors[most_unknowns];
    V before[most_unknowns], mu = splat(1e-2), then = splat(1e300);
    closing.closure_errors(leg, chain, start, target, errors);
    V cost = sum(leg, errors);
    M found{}, rests{};
    const double near = touching * P.length;
    for (int k = 0; k < steps; ++k) {
      if (k % settling == 0) {
        found |= ~(cost > near * near);
        rests |= cost > (1 - settled) * then;
        then = cost;
        if (all(found | rests | ~lanes)) break;
      }
      NormalEquations equations;
      equations.assemble(P, s, leg, errors, target.R);
      equations.damp(leg.unknowns, mu);
      equations.solve(leg.unknowns);
      V norm = splat(0);
      for (int i = 0; i < leg.unknowns; ++i) norm += equations.g[i] * equations.g[i];
      norm = root(norm) * (1 / P.length);
      const V share = select(norm < longest, splat(1), longest / norm);
      for (int i = 0; i < leg.unknowns; ++i) {
        V& x = s.x[unknown[i]];
        before[i] = x;
        x = select(lanes, x + share * equations.g[i] * (1 / P.coordinates[unknown[i]].unit), x);
      }
      closing.closure_errors(leg, chain, start, target, errors);
      const V now = sum(leg, errors);
      const M better = now < cost;
      cost = select(better, now, cost);
      mu = select(better, 0.2 * mu, 8.0 * mu);
      mu = select(mu < 1e-12, splat(1e-12), mu);
      if (all(better | ~lanes)) continue;
      for (int i = 0; i < leg.unknowns; ++i) s.x[unknown[i]] = select(better, s.x[unknown[i]], before[i]);
      closing.closure_errors(leg, chain, start, target, errors);
    }
    return lanes & rests & (cost > near * near);
  }

 private:
  static constexpr double longest = 0.3;  // step, relative to the length

  static V sum(const LegClosure& leg, const V6* errors) {
    V out = splat(0);
    for (int q = 0; q < leg.equations; ++q) out += dot(errors[q], errors[q]);
    return out;
  }
};

}  // namespace stiffmap::kernel
