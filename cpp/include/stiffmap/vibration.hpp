// SPDX-License-Identifier: MIT
// What the tool's frequency response is made of at one pose: modes at the tool, damping between them, and the
// flexibility of all that has no mass or is not kept (theory V1, V2).
#pragma once

#include "stiffmap/modes.hpp"

namespace stiffmap {

/// Per coordinate.
struct Damping {
  VecX viscous;  ///< N·s/m, N·m·s/rad
  VecX loss;     ///< loss factor of its spring or law
};

/// Modes are scaled to unit stiffness: the receptance at s = i w is
/// tip (1 + s viscous + s^2 diag(square) + i sign(w) loss)^-1 tip' + rest.
struct VibrationResult {
  Status status = Status::unreachable;
  std::uint32_t flags = 0;
  Index kept = 0;
  VecX square;             ///< s^2: inverse square of each angular frequency, the largest first; NaN beyond `kept`
  MatX tip;                ///< 6 x modes
  MatX viscous, loss;      ///< modes x modes
  Mat6 rest;               ///< m/N and the like
  double unsymmetric = 0;  ///< norm of what was left out of the tangent to make it symmetric, relative
};

/// `count` modes at most, as seen at the point of the first load; those with dampers and no mass come last.
void tip_modes(const Mechanism& m, const Inertias& inertias, const Damping& damping, const PoseInput& in, Index count,
               SolveWorkspace& ws, VibrationResult& out);

}  // namespace stiffmap
