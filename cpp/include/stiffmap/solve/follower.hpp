// SPDX-License-Identifier: MIT
// Newton on equilibrium with the load as one more unknown, and what happens at a point of a load path.
#pragma once

#include "stiffmap/solve/solve.hpp"

namespace stiffmap {

/// What is prescribed from step to step.
enum class PathControl : std::uint8_t { force, displacement, arc };

struct PathPoint {
  double load = 0, along = 0;  ///< N; displacement of the point along the load, m
  Vec6 displacement;           ///< of the point against its commanded pose
  VecX x;                      ///< coordinates
  int unstable = 0;            ///< directions in which the energy falls under this load
};

/// Where the number of unstable directions changes.
struct CriticalPoint {
  double load = 0, along = 0;
  bool limit = false;  ///< the load has an extremum; otherwise branches cross
  int before = 0, after = 0;
  VecX mode;  ///< per coordinate; the largest motion, angles as arcs at the mechanism's length, is 1
  VecX x;
};

/// An equilibrium and its load.
struct LoadedState {
  State state;
  double load = 0, along = 0;
  int unstable = 0;
};

/// One more equation besides equilibrium: row . (unknowns, load) = value, in scaled unknowns.
struct Constraint {
  PathControl control;
  double target = 0;  ///< load or displacement
  VecX row;           ///< arc: the direction in which the prediction is kept
};

/// A critical point with what is needed to leave it along its mode.
struct Crossing {
  CriticalPoint point;
  LoadedState at;
  VecX mode;  ///< scaled unknowns, then the load; its largest motion is the mechanism's length
};

/// Newton on the bordered tangent, which stays regular at limit points. A step is a vector of scaled
/// unknowns with the scaled load behind them.
class Follower {
 public:
  Follower(const Mechanism& m, const NodePoint& point, const Vec3& direction);

  /// Equilibrium without the load of the path.
  Status start(const PoseInput& in, LoadedState& at_rest, std::uint32_t& flags);
  /// False where Newton is not to be trusted as the continuation of `y`.
  bool correct(const Constraint& c, LoadedState& y);
  /// Direction of the path at the last point corrected: unit length, forwards as seen by `row`.
  VecX tangent(const VecX& row);
  void move(LoadedState& y, const VecX& step) const;
  VecX load_row() const { return VecX::Unit(size_ + 1, size_); }
  /// Displacement along the load per unit of a step.
  double along(const VecX& step) const { return gradient_.dot(step.head(m_.size())); }
  /// Largest motion of a step in multiples of the mechanism's length.
  double motion(const VecX& step) const;
  /// The same between two points.
  double apart(const LoadedState& a, const LoadedState& b) const;
  PathPoint report(const LoadedState& y) const;
  /// The same of a point corrected earlier.
  PathPoint report_again(LoadedState y);
  /// At the last point corrected.
  Crossing critical(const LoadedState& y) const;
  /// From a bifurcation along its mode, by `size` of the mode (either sign), onto the branch that crosses.
  bool leave(const Crossing& from, double size, LoadedState& y);

 private:
  const Mechanism& m_;
  const NodePoint& point_;
  Vec3 d_;
  SolveWorkspace ws_;
  MatX J_, B_;
  Index size_;
  VecX force_, rhs_, gradient_;  ///< gradient of the displacement along the load, scaled unknowns
  Lu lu_;
  double load_unit_ = 1;  ///< N per unit of the scaled load
  Pose nominal_;

  void evaluate(LoadedState& y);
  void border(const VecX& row);
  VecX residual(const Constraint& c, const LoadedState& y, VecX& row);
};

}  // namespace stiffmap
