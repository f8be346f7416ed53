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

struct CompiledChains {
  std::vector<DriveSlot> drives;
  std::vector<ElasticJoint> elastic;
  std::string missing;  ///< why the kernels can not run it; empty: they can
};

/// Fills operations and chains of `out`.
CompiledChains compile_chains(const Mechanism& m, FastPlanData& out);

}  // namespace stiffmap
