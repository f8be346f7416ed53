// SPDX-License-Identifier: MIT
// Chains of a mechanism as lists of operations.
#pragma once

#include <string>
#include <vector>

#include "data.hpp"

namespace stiffmap {

struct DriveSlot {
  std::int32_t coordinate, slot, prismatic;
};

/// A direction of a link spring that became a joint of its own.
struct ElasticJoint {
  std::int32_t coordinate;
  double stiffness, rest;
};

/// Where a point of a chain is: behind how many of its operations, and its frame in theirs.
struct PlaceInChain {
  std::size_t chain, behind;
  Pose nominal, actual;
};

struct CompiledChains {
  std::vector<DriveSlot> drives;
  std::vector<ElasticJoint> elastic;
  std::vector<PlaceInChain> places;  ///< points of the mechanism but the first, which is the tip
  std::string missing;               ///< why the kernels can not run it; empty: they can
  bool deficient = false;            ///< a chain has neither a full link spring, nor a block, nor six joints that yield
};

Constant constant(const Pose& T);

/// Fills operations and chains of `out`.
CompiledChains compile_chains(const Mechanism& m, FastPlanData& out);

}  // namespace stiffmap
