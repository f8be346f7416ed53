// SPDX-License-Identifier: MIT
// In how many directions the energy falls at an equilibrium: the inertia of the whole tangent (theory K4).
#pragma once

#include "stiffmap/stiffness/saddle.hpp"

namespace stiffmap {

/// Columns: motions that keep every loop closed, as lengths, drives held.
MatX closed_motions(const Mechanism& m, const Linearization& lin);

/// Stiffness of springs and laws alone, in coordinates: the tangent without the loads.
MatX springs_only(const Mechanism& m, const Linearization& lin);

/// The tangent over motions Z.
MatX reduced_tangent(const Mechanism& m, const Linearization& lin, const MatX& Z);

/// Whether some small motion grows where all directions are damped alike. A load without a potential may hold what
/// falls without it or not, and of two such directions the sign of the tangent's determinant shows nothing.
bool grows(const Mechanism& m, const Linearization& lin);

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
