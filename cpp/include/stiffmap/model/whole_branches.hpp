// SPDX-License-Identifier: MIT
// Clang 14 does not find the branches of a Block complete where their number is asked before their vector's destructor
// was needed. Include this first in a source that asks.
#pragma once

#include "stiffmap/model/chain.hpp"

namespace stiffmap {

/// Never called.
inline void destroy_branches(std::vector<std::pair<std::string, Chain>>& branches) { branches.~vector(); }

}  // namespace stiffmap
