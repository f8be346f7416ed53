// SPDX-License-Identifier: MIT
// Dynamics of the rigid machine: bodies along a closed motion, projected on the drives (theory D4-D6).
#pragma once

#include "stiffmap/kinematics/motion.hpp"

namespace stiffmap {

/// What one instant asks: motion of the tip, wrench on it and gravity, base axes.
struct DynamicsInput {
  Vec6 twist = Vec6::Zero(), twist_rate = Vec6::Zero();  ///< TCP velocity, angular velocity; their derivatives
  Vec6 wrench = Vec6::Zero();                            ///< on the machine at the TCP
  Vec3 gravity = Vec3::Zero();
  VecX rate, acceleration;  ///< of the drives, where the tip's motion leaves some open; empty: it decides them
};

struct DynamicsResult {
  VecX rate, acceleration;  ///< of the drives
  VecX effort;              ///< that the drives exert, without their friction
  MatX mass;                ///< inertia seen by the drives
  double kinetic = 0;       ///< J
  double potential = 0;     ///< J, of gravity, springs of passive joints and external springs
  double misfit = 0;        ///< part of the tip's motion that the machine cannot do, relative
};

/// Inertias (about the centres of mass, body axes) of the mechanism's bodies, in their order.
using Inertias = std::vector<Mat3>;

/// At closed coordinates x whose frames and loop rates are given; masses of all bodies as in `m`.
void drive_dynamics(const Mechanism& m, const Inertias& inertias, const VecX& x, const Frames& frames,
                    const LoopRates& loops, const Motion& motion, const DynamicsInput& in, DynamicsResult& out);

/// Mass matrix over all coordinates.
MatX coordinate_mass(const Mechanism& m, const Inertias& inertias, const Frames& frames);

}  // namespace stiffmap
