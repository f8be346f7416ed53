// SPDX-License-Identifier: MIT
// Least energy, where Newton's steps go to and fro across the corners of laws.
#pragma once

#include "stiffmap/equilibrium/equilibrium.hpp"

namespace stiffmap {

/// From `state` to a minimum of the energy under the load of `p` (theory E10). False where none was found. The steps'
/// number is added to `out`; the linearisation in `ws` is not that of the answer.
bool settle_downhill(const Mechanism& m, const Problem& p, double tolerance, EquilibriumWorkspace& ws, State& state,
                     EquilibriumResult& out);

}  // namespace stiffmap
