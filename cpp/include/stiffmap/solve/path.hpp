// SPDX-License-Identifier: MIT
// The path of equilibria under a growing load: by load, by the point's displacement or by arc length,
// past limit points (snap-through), with the critical points on the way, their modes, and a branch that
// crosses the path at one of them.
#pragma once

#include "stiffmap/solve/follower.hpp"

namespace stiffmap {

struct PathOptions {
  PathControl control = PathControl::force;
  double limit = 0;  ///< force: largest load, N; otherwise displacement along the load, m
  int steps = 40;    ///< to the limit, if it were reached in a straight line
  int cross = 0;     ///< k: at the k-th bifurcation follow the crossing branch too, -k: to its other side; 0: none
  int most_points = 4000;  ///< of an arc
};

/// Why a branch ends.
enum class PathEnd : std::uint8_t { limit, unreachable, singular, lost, most_points, unloaded, not_followed };

struct Branch {
  PathEnd end = PathEnd::not_followed;
  std::vector<PathPoint> points;
  std::vector<CriticalPoint> critical;
};

struct PathResult {
  std::uint32_t flags = 0;
  Branch path;      ///< from rest
  Branch crossing;  ///< its first point is the bifurcation
};

/// From the equilibrium of `in` (its loads stay as they are) under a dead force along `direction` (unit
/// vector) at the first read point. Never throws for a pose.
PathResult follow_path(const Mechanism& m, const PoseInput& in, const Vec3& direction, const PathOptions& options);

}  // namespace stiffmap
