// SPDX-License-Identifier: MIT
// A machine whose springs are at rest, as far as closing it needs: moving joints, ends of loops, the tip.
#pragma once

#include <array>
#include <vector>

#include "stiffmap/kinematics/kinematics.hpp"

namespace stiffmap {

/// The joints alone: springs at rest, locked coordinates at home, the constant transforms between joints multiplied.
class RigidTree {
 public:
  explicit RigidTree(const Mechanism& m);

  /// Frames of moving joints, of the tip and of the loops' ends; axes and origins of moving joints. Others stay.
  void forward(const VecX& x, Frames& out) const;
  /// Drives and free passive coordinates.
  const std::vector<Index>& moving() const { return moving_; }
  /// Those that move the tip, from the base outwards.
  const std::vector<Index>& tip() const { return tip_; }
  /// Those that move one end of a loop and not the other: primary and end.
  const std::array<std::vector<Index>, 2>& loop(std::size_t l) const { return loops_[l]; }

 private:
  struct Step {
    Index node, parent, coordinate;
    JointType type;
    Pose before;
    Vec3 axis;
  };
  std::vector<Step> steps_;
  std::vector<Index> moving_, tip_;
  std::vector<std::array<std::vector<Index>, 2>> loops_;
};

}  // namespace stiffmap
