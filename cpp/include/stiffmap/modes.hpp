// SPDX-License-Identifier: MIT
// Natural frequencies of the elastic machine with its drives held, about a loaded equilibrium (theory D7).
#pragma once

#include "stiffmap/dense.hpp"
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

/// What vibrates at one pose: motions that keep all loops closed, their tangent and mass.
struct ReducedPose {
  Status status = Status::unreachable;
  std::uint32_t flags = 0;
  MatX Z;             ///< coordinates x motions
  MatX K, S, M;       ///< tangent, its symmetric part, mass
  Cholesky cholesky;  ///< of S
  VecX x;             ///< coordinates at the equilibrium
};

/// False where there is no equilibrium, or none that a small motion comes back to.
bool reduced_pose(const Mechanism& m, const Inertias& inertias, const PoseInput& in, SolveWorkspace& ws,
                  ReducedPose& out);

/// Stiffness of springs and laws alone, in coordinates: the tangent without the loads.
MatX springs_only(const Mechanism& m, const Linearization& lin);

/// The lowest `count` modes at one pose.
void natural_modes(const Mechanism& m, const Inertias& inertias, const PoseInput& in, Index count, SolveWorkspace& ws,
                   ModesResult& out);

}  // namespace stiffmap
