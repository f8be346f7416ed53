// SPDX-License-Identifier: MIT
// Natural frequencies of the elastic machine with its drives held, about a loaded equilibrium (theory D7).
#pragma once

#include "stiffmap/dynamics.hpp"
#include "stiffmap/solve.hpp"

namespace stiffmap {

struct ModesResult {
  Status status = Status::unreachable;
  std::uint32_t flags = 0;
  VecX square;  ///< (rad/s)^2, lowest first; NaN beyond the last
  MatX shape;   ///< coordinates x modes, of unit modal mass
  VecX x;       ///< coordinates at the equilibrium
};

/// The lowest `count` modes at one pose.
void natural_modes(const Mechanism& m, const Inertias& inertias, const PoseInput& in, Index count, SolveWorkspace& ws,
                   ModesResult& out);

}  // namespace stiffmap
