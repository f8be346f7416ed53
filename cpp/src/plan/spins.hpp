// SPDX-License-Identifier: MIT
// Spins that weights turn, as the kernels need them.
#pragma once

#include "data.hpp"
#include "stiffmap/equilibrium/spins.hpp"

namespace stiffmap {

/// Lists the held spins in `d.spins` and lets those go that move a body in `d.hanging_ops`; false where one is no turn
/// of a rod about two axes along the line between them, with nothing but joints, springs and bodies on the way, or
/// where one that moves no body's centre is not that of a round rod.
bool let_spins_hang(const Mechanism& m, const Spins& spins, FastPlanData& d);

}  // namespace stiffmap
