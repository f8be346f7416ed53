// SPDX-License-Identifier: MIT
// Machines with more drives than a commanded pose needs (theory C11).
#pragma once

#include "stiffmap/model/mechanism.hpp"

namespace stiffmap {

/// Sets `redundancy` and `nearness` of a machine whose home is closed and whose spins are held: how many motions of
/// its drives the commanded components of a pose leave open, anywhere and not at a singular home alone, and which
/// coordinates count in the distance: the drives, or all joints where the drives alone do not decide.
void find_redundancy(Mechanism& m);

}  // namespace stiffmap
