// SPDX-License-Identifier: MIT
// A leg without loops at home: what moves in its closure, for the closed forms.
#pragma once

#include <optional>

#include "data.hpp"

namespace stiffmap {

struct HomeJoint {
  std::int32_t coordinate;
  bool prismatic;
  Vec3 axis, point;
};

/// What moves in the closure, and the frame at a chain's end, at home in base axes.
struct HomeLeg {
  std::vector<HomeJoint> joints;
  Pose end;
};

/// Leg number `leg` of a machine whose legs alone move; nothing where it has loops.
std::optional<HomeLeg> leg_at_home(const Mechanism& m, const FastPlanData& d, int leg);

}  // namespace stiffmap
