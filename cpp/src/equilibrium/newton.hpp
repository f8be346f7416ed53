// SPDX-License-Identifier: MIT
// Newton's steps at one load: what the ways to the whole load share.
#pragma once

#include "stiffmap/equilibrium/equilibrium.hpp"

namespace stiffmap {

/// Distrusted: the steps do not shrink fast.
enum class Outcome { converged, failed, distrusted };

/// Newton at one load. Whether a gap bears a force next to round-off is found by trying: where Newton does not settle
/// with it, it was noise. `trusting`: leave as soon as the first steps do not shrink fast, so that the result is the
/// continuation of the start and no other root (theory E9). `cold`: laws with corners are linear in the first
/// iteration. Steps below
/// `harmless`, in lengths, need not shrink.
Outcome newton(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, bool cold, bool trusting,
               EquilibriumWorkspace& ws, State& state, EquilibriumResult& out, double harmless = 1e-7);

/// Whether a law with corners is at another of its pieces than where the slopes of all laws were `slopes`.
bool at_other_pieces(const Mechanism& m, const Linearization& lin, const VecX& slopes);

/// Forces balance and loops are closed: a vanishing step alone says nothing where the tangent is singular.
bool in_balance(const Mechanism& m, const EquilibriumWorkspace& ws);

}  // namespace stiffmap
