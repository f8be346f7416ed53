// SPDX-License-Identifier: MIT
#pragma once

#include "passes.hpp"

namespace stiffmap::bench {

/// Floating-point additions, subtractions, multiplications, divisions and square roots per pose.
struct Counts {
  double operations[pass_count];
};

/// Counted by running the kernel's source with a lane type that counts: as written, before the
/// compiler drops what it can prove useless.
Counts count_operations(const Program&, const KernelInput&, const KernelOutput&);

}  // namespace stiffmap::bench
