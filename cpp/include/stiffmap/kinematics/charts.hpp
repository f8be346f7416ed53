// SPDX-License-Identifier: MIT
// Free ball joints numbered anew, so that no configuration is near the lock of their axes (theory C8).
#pragma once

#include "stiffmap/model/mechanism.hpp"

namespace stiffmap {

/// Constant rotations around the three axes of ball joints: a joint's rotation is before · E(q) · after.
struct Charts {
  struct Turn {
    Mat3 before = Mat3::Identity(), after = Mat3::Identity();
    bool used = false;
  };
  std::vector<Turn> turns;  ///< per ball of the mechanism; none: the axes are as they were made

  bool plain() const { return turns.empty(); }
};

/// Spread of its axes below which a free ball is numbered anew: a load step turns it by less than what is before its
/// lock.
inline constexpr double narrow = 0.3;

/// Numbers each free ball anew whose axes span less than `narrow`: its second coordinate goes to where they are
/// perpendicular, the others stay, and so does the joint's rotation. True where one has changed.
bool keep_off_locks(const Mechanism& m, VecX& x, Charts& charts);

/// Coordinates of the same configuration by the axes as they were made, of two the nearer to `near`.
VecX by_own_axes(const Mechanism& m, const Charts& charts, const VecX& x, const VecX& near);

}  // namespace stiffmap
