// SPDX-License-Identifier: MIT
// How the legs of a plan are closed: equations, closed forms, starts on a grid.
#pragma once

#include "data.hpp"

namespace stiffmap {

/// Legs close one by one only where nothing before or behind their block moves.
bool only_legs_have_joints(const Mechanism& m, const FastPlanData& d);

/// Closure equations of each leg: its end against the command, and each loop inside it; false: too many.
bool compile_closure(const Mechanism& m, FastPlanData& out);

/// The same for the whole machine at once: every loop, and the commanded components of the tip.
bool compile_whole_closure(const Mechanism& m, FastPlanData& out);

/// How far each leg can stretch.
void bound_reach(const Mechanism& m, FastPlanData& out);

/// Closed forms, if every leg has one.
void recognise_planar_legs(const Mechanism& m, FastPlanData& out);

/// The closed form of an arm, if the only leg has one.
void recognise_arm(const Mechanism& m, FastPlanData& out);

/// Closed configurations on a grid over a box of tip positions.
void place_grid(const Mechanism& m, const Vec3& low, const Vec3& high, int grid_nodes, FastPlanData& out);

}  // namespace stiffmap
