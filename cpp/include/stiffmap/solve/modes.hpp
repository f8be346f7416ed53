// SPDX-License-Identifier: MIT
// What vibrates at one pose, its drives held, about a loaded equilibrium: modes, as all coordinates and as the tool
// move in them, damping between them, and the flexibility of all that has no mass or is not kept (theory D7, V1, V2).
#pragma once

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/kinematics/dynamics.hpp"
#include "stiffmap/solve/solve.hpp"

namespace stiffmap {

/// Per coordinate; empty where there is none.
struct Damping {
  VecX viscous;  ///< N·s/m, N·m·s/rad
  VecX loss;     ///< loss factor of its spring or law
};

/// Modes are scaled to unit stiffness: the receptance at s = i w is
/// tip (1 + s viscous + s^2 diag(square) + i sign(w) loss)^-1 tip' + rest.
struct ModesResult {
  Status status = Status::unreachable;
  std::uint32_t flags = 0;
  Index kept = 0;
  VecX x;                  ///< coordinates at the equilibrium
  VecX square;             ///< s^2: inverse square of each angular frequency, the largest first; NaN beyond `kept`
  MatX shape;              ///< coordinates x modes
  MatX tip;                ///< 6 x modes
  MatX viscous, loss;      ///< modes x modes
  Mat6 rest;               ///< m/N and the like
  double unsymmetric = 0;  ///< norm of the tangent's part that is not symmetric, relative
};

/// `count` modes at most, at the point of the first load; those with dampers and no mass come last. Of a tangent that
/// dead moments make unsymmetric: of its symmetric part, or, `whole`, as it is, and unstable where frequencies are
/// complex.
void lowest_modes(const Mechanism& m, const Inertias& inertias, const Damping& damping, const PoseInput& in,
                  Index count, bool whole, SolveWorkspace& ws, ModesResult& out);

}  // namespace stiffmap
