// SPDX-License-Identifier: MIT
// What pushes on the mechanism: wrenches at points of its bodies, and gravity.
#pragma once

#include <vector>

#include "stiffmap/algebra/types.hpp"

namespace stiffmap {

/// How a wrench follows the rotation R of its body since the command (theory E6): dead keeps its base
/// axes, follower becomes R F; semitangential keeps the force and has the conservative moment
/// (tr(R) I - R^T) m / 2, which takes half of a small rotation.
enum class LoadType : std::uint8_t { dead, follower, semitangential };

/// Whether a wrench has no potential (theory E6): a dead moment, anything that follows its body.
inline bool nonconservative(LoadType type, const Vec6& wrench) {
  if (type == LoadType::semitangential) return false;
  return type == LoadType::follower ? !wrench.isZero(0) : !wrench.tail<3>().isZero(0);
}

/// Where a wrench acts: a point fixed in the frame of a node.
struct LoadPoint {
  Index node = -1;
  Vec3 offset = Vec3::Zero();
  LoadType type = LoadType::dead;
};

}  // namespace stiffmap
