// SPDX-License-Identifier: MIT
// In how many directions the energy falls at an equilibrium: the inertia of the whole tangent (theory K4).
#pragma once

#include "stiffmap/saddle.hpp"

namespace stiffmap {

/// Scratch of one thread, and the count.
class Stability {
 public:
  /// Negative eigenvalues of the tangent's symmetric part beyond those of the independent closures: those of
  /// the energy's Hessian over the motions that keep the loops closed.
  Index falling(const SaddleSystem& saddle);

 private:
  std::vector<Index> elastic_, rest_;
  MatX K_, B_, S_;
  bool eliminated(const MatX& A);
};

}  // namespace stiffmap
