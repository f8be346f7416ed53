// SPDX-License-Identifier: MIT
// Kinematics by closure with the springs at rest: from a platform pose to the coordinates, and from
// the actuators to the pose, by continuation from home so that the assembly branch is kept.
#pragma once

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/kinematics/kinematics.hpp"

namespace stiffmap {

/// Scratch of one thread.
struct ClosureWorkspace {
  explicit ClosureWorkspace(const Mechanism& m);
  Frames frames;
  Charts charts;          ///< by which the unknowns of free balls count, within one search
  bool renumber = false;  ///< free balls are numbered anew on the way
  MatX J, A;
  VecX e, step, right, shortest, x, trial, start;
  std::vector<Index> unknown;
  Orthogonal qr;
  bool redundant = false;  ///< the unknowns have motions that a commanded tip leaves open (theory C11)
  VecX wanted;             ///< coordinates to stay near to
  VecX multipliers;
  MatX H, bordered;
};

struct ClosureResult {
  Status status = Status::unreachable;
  std::uint32_t flags = 0;
  int iterations = 0;
  double residual = 0;  ///< length of the closure error, m
  bool exact = true;    ///< closed but for round-off; otherwise as well as the input's digits allow (theory C9)
  Pose tip;
};

/// Coordinates `x` at which the tip has the pose (nominal geometry, springs zero).
ClosureResult inverse_closure(const Mechanism& m, const Pose& pose, ClosureWorkspace& ws, VecX& x);

/// The same, continued from the coordinates `from` of another pose `at` instead of from home.
ClosureResult inverse_closure(const Mechanism& m, const Pose& pose, ClosureWorkspace& ws, VecX& x, const VecX& from,
                              const Pose& at);

/// Coordinates `x` and tip pose for given actuator coordinates.
ClosureResult forward_closure(const Mechanism& m, const VecX& actuators, ClosureWorkspace& ws, VecX& x);

/// The same, continued from the joint coordinates of `from` (closed first, its actuators held) instead of from home.
ClosureResult forward_closure(const Mechanism& m, const VecX& actuators, ClosureWorkspace& ws, VecX& x,
                              const VecX& from);

/// Coordinates at which the tip has the pose, on the assembly branch of the joint coordinates `from`: these are
/// closed with their actuators held, then continued to the pose. Never from home.
ClosureResult branch_closure(const Mechanism& m, const Pose& pose, ClosureWorkspace& ws, VecX& x, const VecX& from);

/// What there is to say of coordinates that are closed already: tip pose and limits; NaN is out of reach.
ClosureResult given_closure(const Mechanism& m, ClosureWorkspace& ws, const VecX& x);

/// Moves passive coordinates only, tip and actuators held, to close the loops again (Gauss-Newton of
/// least norm); returns the remaining error.
double close_passive(const Mechanism& m, const Pose& tip, ClosureWorkspace& ws, VecX& x);

}  // namespace stiffmap
