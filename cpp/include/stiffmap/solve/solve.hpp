// SPDX-License-Identifier: MIT
// One pose from command to answer: closure, equilibrium, stiffness, and what kind of pose it is.
#pragma once

#include "stiffmap/closure/closure.hpp"
#include "stiffmap/equilibrium/spins.hpp"

namespace stiffmap {

/// What one pose asks.
struct PoseInput {
  Pose commanded;  ///< tip, base axes
  Vec3 gravity = Vec3::Zero();
  std::vector<LoadPoint> load_points;
  std::vector<Vec6> wrenches;      ///< one per load point
  std::vector<Index> read_points;  ///< indices into Mechanism::points; the first defines stiffness
  const double* closed = nullptr;  ///< coordinates already closed at the commanded pose; null: found by closure
};

/// A load at a point of the mechanism.
inline LoadPoint load_at(const Mechanism& m, Index point, LoadType type = LoadType::dead) {
  const NodePoint& p = m.points[at(point)];
  return {p.node, p.offset, type};
}

struct SolveOptions {
  EquilibriumOptions equilibrium;
  bool stiffness = true;  ///< false: displacements only
};

struct PoseResult {
  Status status = Status::unreachable;
  std::uint32_t flags = 0;
  int iterations = 0;
  std::vector<Vec6> displacement;  ///< per read point: translation, rotation vector
  StiffnessResult point;
  VecX effort;  ///< per drive
  Eigen::Matrix<double, 6, Eigen::Dynamic> leg_wrench;
  VecX x;                           ///< coordinates at equilibrium
  std::vector<bool> indeterminate;  ///< passive coordinates that the pose leaves open
};

/// Everything one thread needs; allocated once per mechanism.
struct SolveWorkspace {
  explicit SolveWorkspace(const Mechanism& m);
  ClosureWorkspace closure;
  EquilibriumWorkspace equilibrium;
  StiffnessWorkspace stiffness;
  Spins spins;
  Problem problem;
  State state;
  Frames nominal;
  VecX x;
  Pose reached;  ///< nominal tip pose: the commanded one, completed where the task leaves it open
};

/// Never throws for a pose: see PoseResult::status.
void solve_pose(const Mechanism& m, const PoseInput& in, const SolveOptions& options, SolveWorkspace& ws,
                PoseResult& out);

/// The parts of it that other problems share. Closure and command: fills x, reached, nominal, problem
/// and the unloaded state.
ClosureResult prepare_pose(const Mechanism& m, const PoseInput& in, SolveWorkspace& ws);

/// Everything reported of an equilibrium whose state and linearisation are in
/// `ws`.
void conclude_pose(const Mechanism& m, const PoseInput& in, const EquilibriumResult& eq, SolveWorkspace& ws,
                   PoseResult& out);

/// NaN and the status.
void fail_pose(const Mechanism& m, const PoseInput& in, Status status, PoseResult& out);

}  // namespace stiffmap
