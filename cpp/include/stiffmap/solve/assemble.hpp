// SPDX-License-Identifier: MIT
// From a chain as a person writes it to a mechanism that can be solved.
#pragma once

#include "stiffmap/closure/free_spins.hpp"
#include "stiffmap/closure/home_record.hpp"

namespace stiffmap {

/// Mechanism closed at home but for round-off, spins locked: ready to solve. Throws HomeMisfit; `fit`: how the
/// declared home configuration closes; `like`: a mechanism with which, and with all made like it, findings about home
/// are shared where the nominal geometry is the same.
Mechanism assemble(const Chain& root, const Pose& home, const std::vector<ExternalSpring>& springs = {},
                   const Task& task = full_task, HomeSearch search = HomeSearch::near, HomeFit* fit = nullptr,
                   const Mechanism* like = nullptr);

}  // namespace stiffmap
