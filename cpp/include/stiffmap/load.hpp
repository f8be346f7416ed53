// SPDX-License-Identifier: MIT
// What pushes on the mechanism: wrenches at points of its bodies, and gravity.
#pragma once

#include <vector>

#include "stiffmap/types.hpp"

namespace stiffmap {

/// How a wrench follows the body that it acts on (theory E6): dead keeps its base axes, follower
/// turns with the body, semitangential takes half of the moment's rotation (forces stay dead).
enum class LoadType : std::uint8_t { dead, follower, semitangential };

/// Where a wrench acts: a point fixed in the frame of a node.
struct LoadPoint {
  Index node = -1;
  Vec3 offset = Vec3::Zero();
  LoadType type = LoadType::dead;
};

}  // namespace stiffmap
