// SPDX-License-Identifier: MIT
// The path of equilibria under a growing load: by load, by the point's displacement or by arc length,
// past limit points (snap-through), with the critical points on the way and their modes.
#pragma once

#include "stiffmap/solve.hpp"

namespace stiffmap {

/// What is prescribed from step to step.
enum class PathControl : std::uint8_t { force, displacement, arc };

struct PathOptions {
  PathControl control = PathControl::force;
  double limit = 0;        ///< force: largest load, N; otherwise displacement along the load, m
  int steps = 40;          ///< to the limit, if it were reached in a straight line
  int most_points = 4000;  ///< of an arc
};

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

struct PathResult {
  Status status = Status::unreachable;  ///< converged: the limit was reached
  std::uint32_t flags = 0;
  std::vector<PathPoint> points;
  std::vector<CriticalPoint> critical;
};

/// From the equilibrium of `in` (its loads stay as they are) under a dead force along `direction` (unit
/// vector) at the first read point. Never throws for a pose.
PathResult follow_path(const Mechanism& m, const PoseInput& in, const Vec3& direction, const PathOptions& options);

}  // namespace stiffmap
