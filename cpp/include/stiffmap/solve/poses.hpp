// SPDX-License-Identifier: MIT
// One question to a machine at many poses, on all threads; what a pose is answered depends on nothing but the pose.
#pragma once

#include "stiffmap/common/answers.hpp"
#include "stiffmap/plan/fast_plan.hpp"
#include "stiffmap/solve/modes.hpp"

namespace stiffmap {

/// `position` and `rotation`: poses x 3 and 9, commanded, with a dead `wrench` at each; gravity is the same at all.
///
/// Coordinates and tip poses by closure: from poses where rotations are given, else from the actuators' coordinates; on
/// the branch of `start` where it is given. The plan, which may be null, knows starts near by.
Answers closures(const Mechanism& m, const FastPlan* plan, const Rows& given, const Rows& rotation, const Rows& start,
                 int threads);

/// Coordinates and drive Jacobian. `start`: coordinates near the answer (NaN: none known). `only`: poses are continued
/// from their starts and nowhere else. `weights`: of the drives, or none.
Answers kinematics(const Mechanism& m, const Rows& position, const Rows& rotation, const Rows& start,
                   const VecX& weights, bool patient, bool only, int threads);

/// Coordinates and their slopes over cells: centre + axes * d, |d_k| <= half_k. `start` as above.
Answers enclosures(const Mechanism& m, const Rows& centre, const Rows& half, const Mat3& axes, const Mat3& rotation,
                   const Rows& start, Index slopes, const std::vector<Index>& watched, int threads);

/// Drive efforts at closed coordinates and tip motions; rates and accelerations of the drives: as many rows, or none.
Answers dynamics(const Mechanism& m, const Inertias& inertias, const Rows& coordinates, const Rows& twist,
                 const Rows& twist_rate, const Rows& wrench, const Vec3& gravity, const Rows& rates,
                 const Rows& accelerations, const VecX& weights, int threads);

/// Modes at a point (modes.hpp); their shapes where the tangent is taken whole. `closed`: coordinates already closed at
/// the poses, NaN where they are not.
Answers modes(const Mechanism& m, const Inertias& inertias, const VecX& viscous, const VecX& loss, const Rows& position,
              const Rows& rotation, const Rows& wrench, const Vec3& gravity, const Rows& closed,
              const std::string& point, Index count, bool whole, int threads);

/// Wrenches that hold a point at displacements (poses x 6) from its commanded poses.
Answers clamps(const Mechanism& m, const Rows& position, const Rows& rotation, const Rows& displacement,
               const std::string& point, const Vec3& gravity, int threads);

/// Generalised forces of all springs, drives and locked coordinates at loaded poses.
Answers reactions(const Mechanism& m, const Rows& position, const Rows& rotation, const Rows& wrench,
                  const std::string& point, const Vec3& gravity, int threads);

/// Frames of all nodes, one after the other, at given coordinates, nominal geometry.
Answers node_frames(const Mechanism& m, const VecX& x);

/// A point at each row of coordinates, nominal geometry.
Answers point_positions(const Mechanism& m, const std::string& point, const Rows& x);

}  // namespace stiffmap
