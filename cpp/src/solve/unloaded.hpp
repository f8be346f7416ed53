// SPDX-License-Identifier: MIT
// A mechanism at closed coordinates, with its drives' errors, before anything loads it.
#pragma once

#include "stiffmap/equilibrium/equilibrium.hpp"
#include "stiffmap/stiffness/stiffness.hpp"

namespace stiffmap::unloaded {

/// Drive and guide coordinates with their errors, compliances of drives and links at that stroke (theory G1-G4, S3),
/// with the problem's gravity; false where a link has none.
bool command(const Mechanism& m, const VecX& x, Problem& p);

/// Where the laws about a home coordinate stand.
void start_state(const Mechanism& m, const VecX& x, State& state);

/// Stiffness of a point at closed coordinates that nothing loads.
class Unloaded {
 public:
  explicit Unloaded(const Mechanism& m) : m_(m), problem_(m), state_(m), lin_(m), saddle_(m), ws_(m) {
    problem_.secant_laws = true;
  }

  /// NaN where a command is out of its table.
  Mat6 stiffness(const VecX& x, const NodePoint& point);

 private:
  const Mechanism& m_;
  Problem problem_;
  State state_;
  Linearization lin_;
  SaddleSystem saddle_;
  StiffnessWorkspace ws_;
};

/// Largest difference of two stiffnesses, relative to the second one's diagonal.
double change(const Mat6& K, const Mat6& before);

}  // namespace stiffmap::unloaded
