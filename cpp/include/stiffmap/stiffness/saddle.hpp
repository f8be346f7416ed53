// SPDX-License-Identifier: MIT
// The scaled bordered tangent [K - H, -J^T; -J, 0] of theory (E7): assembly, solution, inertia.
#pragma once

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/stiffness/linearization.hpp"

namespace stiffmap {

/// Numbers of positive, negative and (below the threshold) zero eigenvalues.
struct Inertia {
  Index positive = 0, negative = 0, zero = 0;
};

/// Inertia of a symmetric matrix by Bunch-Parlett elimination (destroys A); all zero where an entry is not finite.
Inertia symmetric_inertia(MatX& A, double threshold);

/// Unknowns are z (all coordinates) and the loop wrenches. Fixed coordinates keep a unit row. Scaling
/// turns every entry into a multiple of the mechanism's stiffness at its length, so that pivots are
/// dimensionless.
class SaddleSystem {
 public:
  explicit SaddleSystem(const Mechanism& m);

  void assemble(const Mechanism& m, const Linearization& lin);
  /// Adds stiffness to every coordinate that is not fixed, in multiples of the machine's or of its own.
  void stiffen(double by);
  /// Factorises; falls back to a rank-revealing factorisation where pivots are small.
  void factorize();
  /// Solves T [dz; dlambda] = [force; closure]; the least-squares solution of least norm where T is
  /// rank-deficient (theory E8).
  void solve(const VecX& force, const VecX& closure, VecX& dz, VecX& dlambda);
  /// Orthonormal basis (columns, scaled unknowns) of the null space.
  MatX null_space() const;

  /// From scaled unknowns to (z, lambda), in place.
  void to_coordinates(VecX& v) const;
  /// From forces and closure errors to the right-hand side of the scaled system, in place.
  void to_forces(VecX& v) const;
  /// Columns of a Jacobian by coordinates to columns by scaled unknowns, in place.
  void to_unknowns(const Linearization& lin, Eigen::Ref<MatX> J) const;
  const MatX& matrix() const { return A_; }
  const VecX& scale() const { return s_; }                 ///< z = scale * unknown
  const std::vector<Kind>& kind() const { return kind_; }  ///< per unknown of the coordinates
  bool regular() const { return regular_; }
  double determinant_sign() const { return sign_; }
  Index closures() const { return nl_; }
  Index closure_rank() const;
  /// Norm of a step in multiples of the mechanism's length.
  double step_norm(const Mechanism& m, const VecX& dz) const;
  /// Scaled norm of residual and closure error: the merit of the line search.
  double merit(const Linearization& lin) const;

 private:
  Index n_, nl_;
  MatX A_;
  VecX s_, rhs_, sol_;
  std::vector<Kind> kind_;
  std::vector<std::pair<Index, SpringMatrix>> rotated_;  // springs with hidden rigid directions
  Lu lu_;
  Orthogonal cod_;
  bool regular_ = true, well_conditioned_ = true;
  double sign_ = 1;
};

}  // namespace stiffmap
