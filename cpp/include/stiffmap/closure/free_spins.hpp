// SPDX-License-Identifier: MIT
// Rods that turn about themselves: found at home, numbered by a coordinate of their own, held (theory C6, C8).
#pragma once

#include "stiffmap/closure/closure.hpp"

namespace stiffmap {

/// Locks passive coordinates that spin without effect on any frame that carries load (theory C6); the home
/// configuration must be closed. Returns them.
std::vector<Index> lock_spins(Mechanism& m);

/// Free ball joints about which a body spins in such a way that the spin would mix with their other coordinates, with
/// axes of which one is the line of the spin (theory C8); the home configuration must be closed.
std::vector<SpunBall> balls_to_renumber(const Mechanism& m);

/// The chain with these axes; the joints' home coordinates are zero.
Chain renumbered(const Mechanism& m, const std::vector<SpunBall>& balls);

}  // namespace stiffmap
