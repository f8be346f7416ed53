// SPDX-License-Identifier: MIT
// Loaded equilibrium: Newton on the exact tangent with line search and load continuation.
#pragma once

#include "stiffmap/stiffness/stability.hpp"

namespace stiffmap {

struct EquilibriumOptions {
  int load_steps = 0;        ///< 0: adaptive continuation; n: n equal steps
  int max_iterations = 40;   ///< per load step
  bool path_ends = false;    ///< the kernels found that the path of equilibria ends before the whole load
  double tolerance = 1e-10;  ///< last Newton step, in multiples of the mechanism's length
};

struct EquilibriumResult {
  Status status = Status::not_converged;
  std::uint32_t flags = 0;
  int iterations = 0;
  double contraction = 0;  ///< of the second Newton step against the first, at the last load
  int sign_changes = 0;    ///< of the tangent's determinant, from one load step to the next
  Index falling = 0;       ///< directions in which the energy falls at the answer (theory K4)
};

/// Scratch of one thread.
struct EquilibriumWorkspace {
  explicit EquilibriumWorkspace(const Mechanism& m);
  Linearization lin;
  SaddleSystem saddle;
  Stability stability;
  State start, step_start, before, settled;
  bool met_gap = false;  ///< a law without stiffness left something loose
  VecX dz, dlambda, force, slope, slope_before, no_closure, pieces, pieces_before;
};

/// Free balls whose axes have come near their lock are numbered anew, the configuration stays: near a lock the balance
/// of moments says nothing about one direction. True where one has changed.
bool off_locks(const Mechanism& m, const Problem& p, State& state);

/// The linearisation at `state` in `ws`, factorised.
void factorize_at(const Mechanism& m, const Problem& p, const State& state, EquilibriumWorkspace& ws);

/// Right-hand side of the force balance; a stuck coordinate follows its own law alone.
void force_balance(const Mechanism& m, const Linearization& lin, const SaddleSystem& saddle, VecX& force);

/// Most that a load moves at once, of the machine's length: beyond it the answer may be another assembly's.
inline constexpr double largest_step = 0.2;

/// Whether the tip went that far at once: with corners of laws the load is then taken in steps.
inline bool leaps(const Mechanism& m, const Pose& from, const Pose& to) {
  return !(distance(from, to, m.length) < largest_step * m.length);
}

/// Laws of which the deflection does not say the force.
bool rubs_or_sticks(const Mechanism& m);

/// Laws with corners or with dry friction: Newton starts from the solution with all laws linear.
bool has_knots(const Mechanism& m);

/// From `state` (usually the commanded configuration, all zero) to the equilibrium under `problem`.
/// On success `ws.lin` and `ws.saddle` hold the linearisation there. Status is converged or
/// not_converged; who asks judges stability by `falling` and `sign_changes`.
EquilibriumResult solve_equilibrium(const Mechanism& m, Problem& problem, const EquilibriumOptions& options,
                                    EquilibriumWorkspace& ws, State& state);

}  // namespace stiffmap
