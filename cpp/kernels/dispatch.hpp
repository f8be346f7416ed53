// SPDX-License-Identifier: MIT
// Chooses the kernel for this processor; the environment variable STIFFMAP_ISA (base, v3, v4) overrides.
#pragma once

#include <string>
#include <vector>

#include "program.hpp"

namespace stiffmap {

/// Levels built into this library that the processor can run, lowest first.
std::vector<std::string> kernel_levels();

/// Kernel of STIFFMAP_ISA or the highest level; throws std::invalid_argument for a level that is
/// unknown or that this processor cannot run.
const KernelTable& kernel();

/// The same for a call on `count` poses: one or two take the level's two-lane build, which gives the same bits.
const KernelTable& kernel(std::int64_t count);

}  // namespace stiffmap
