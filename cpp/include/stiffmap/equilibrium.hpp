// SPDX-License-Identifier: MIT
// Loaded equilibrium: Newton on the exact tangent with line search and load continuation.
#pragma once

#include "stiffmap/saddle.hpp"

namespace stiffmap {

struct EquilibriumOptions {
  int load_steps = 0;        ///< 0: adaptive continuation; n: n equal steps
  int max_iterations = 40;   ///< per load step
  double tolerance = 1e-10;  ///< last Newton step, in multiples of the mechanism's length
};

struct EquilibriumResult {
  Status status = Status::not_converged;
  std::uint32_t flags = 0;
  int iterations = 0;
  double last_step = 0;
  int sign_changes = 0;  ///< of the tangent's determinant, from one load step to the next
};

/// Scratch of one thread.
struct EquilibriumWorkspace {
  explicit EquilibriumWorkspace(const Mechanism& m);
  Linearization lin;
  SaddleSystem saddle;
  State start, step_start, before;
  VecX dz, dlambda, force;
};

/// Right-hand side of the force balance; a stuck coordinate follows its own law alone.
void force_balance(const Mechanism& m, const Linearization& lin, const SaddleSystem& saddle, VecX& force);

/// From `state` (usually the commanded configuration, all zero) to the equilibrium under `problem`.
/// On success `ws.lin` and `ws.saddle` hold the linearisation there. Status is converged or
/// not_converged; stability is judged by `judge_stability` in stiffness.hpp.
EquilibriumResult solve_equilibrium(const Mechanism& m, Problem& problem, const EquilibriumOptions& options,
                                    EquilibriumWorkspace& ws, State& state);

}  // namespace stiffmap
