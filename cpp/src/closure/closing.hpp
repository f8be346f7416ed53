// SPDX-License-Identifier: MIT
// Gauss-Newton on the closure equations: what poses and the home configuration share.
#pragma once

#include "stiffmap/closure/closure.hpp"

namespace stiffmap::closing {

/// Closure errors relative to the mechanism's length: round-off, and what the digits of a file or of a
/// commanded pose may leave (a millionth of the machine's size, which is about two lengths).
inline constexpr double round_off = 1e-12, input_tolerance = 2e-6;

/// What is to be closed: the loops, and the tip where its pose is given.
struct Target {
  const Pose* tip = nullptr;
  Task task = full_task;

  /// Zero in the components of a tip error (or its Jacobian) that are not commanded.
  template <class Rows>
  void mask(Rows&& rows) const {
    if (task == full_task) return;
    rows.template bottomRows<3>() = (tip->R.transpose() * rows.template bottomRows<3>()).eval();
    for (int i = 0; i < 6; ++i)
      if (!task[static_cast<std::size_t>(i)]) rows.row(i).setZero();
  }
};

/// Contracting: gives up unless the steps shrink fast (theory C5), so that the solution is the continuation
/// of the start. Damped: steps limited, as many as it takes.
enum class Pace { contracting, damped };

/// Joints that may move, locked spins and (unless wanted) actuators left out.
void select_unknowns(const Mechanism& m, bool actuators, ClosureWorkspace& ws);

/// Equations besides the loops: where the tip is not given, the winches say how long each cable's way is.
inline Index winches(const Mechanism& m, const Target& target) {
  return target.tip ? 0 : static_cast<Index>(m.cables.size());
}

/// Residual, angles as lengths; returns its largest entry relative to the length.
double residual(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws);

/// Fills ws.A: slopes of the residual by the unknowns, both as lengths, at the frames of the last residual.
void equations(const Mechanism& m, const Target& target, ClosureWorkspace& ws);

/// Gauss-Newton step of least norm over the unknowns, at the frames of the last residual.
double newton_step(const Mechanism& m, const Target& target, ClosureWorkspace& ws);

/// Of a redundant machine (theory C11), with ws.wanted as what to stay near to: multipliers that fit x best, Newton's
/// step for the nearest closed configuration, and whether x is nearer than all about it.
void estimate_multipliers(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws);
double nearest_step(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws);
bool is_nearest(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws);

/// Flags of closed coordinates beyond a range, and of balls that are not free near their lock.
std::uint32_t limits_met(const Mechanism& m, const VecX& x);

/// Newton to the target, or to the nearest configuration where equations that contradict each other
/// leave no more than the input tolerance (theory C9).
bool close(const Mechanism& m, const Target& target, Pace pace, ClosureWorkspace& ws, VecX& x, int& iterations);

}  // namespace stiffmap::closing
