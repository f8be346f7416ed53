// SPDX-License-Identifier: MIT
// Equilibrium of a platform that hangs in cables alone: the lowest energy downhill from the command (theory B5).
#pragma once

#include "stiffmap/stiffness/linearization.hpp"

namespace stiffmap {

struct FloatingResult {
  bool found = false;
  int iterations = 0;
  bool leapt = false;  ///< far from the command: another minimum may be nearer
};

/// From the commanded configuration in `p` to the coordinates at which the energy has a minimum, into `x`. Energy
/// falls with every step, whichever cables are slack on the way; nothing needs to be known of which they are.
FloatingResult find_floating(const Mechanism& m, const Problem& p, VecX& x);

}  // namespace stiffmap
