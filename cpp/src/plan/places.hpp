// SPDX-License-Identifier: MIT
// Named points as the kernels find them: by the tip, or by the operations that lead to their bodies.
#pragma once

#include "chains.hpp"

namespace stiffmap {

/// Fills the places of `out`, in the order of the mechanism's points. Operations and chains must be known.
void compile_places(const Mechanism& m, const CompiledChains& chains, FastPlanData& out);

/// Frame in the tip's, nominal and actual, of a node from which only constant transforms lead to the tip.
struct FromTip {
  bool rigid = true;
  Pose nominal, actual;
};
FromTip from_tip(const Mechanism& m, Index node);

}  // namespace stiffmap
