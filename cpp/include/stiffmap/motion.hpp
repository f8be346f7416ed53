// SPDX-License-Identifier: MIT
// First-order kinematics of a closed machine: rates of all coordinates and of the tip per drive rate,
// springs at rest (theory D1-D3).
#pragma once

#include <vector>

#include "stiffmap/dense.hpp"
#include "stiffmap/rigid_tree.hpp"

namespace stiffmap {

using Mat6X = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Rates at one configuration.
struct Motion {
  MatX rates;         ///< coordinates x drives; rate of every coordinate per unit rate of a drive
  Mat6X J;            ///< tip twist per unit rate of a drive, base axes
  Vec6 free_twist;    ///< of the tip, with all drives held; NaN where there is none
  double pivot = 1;   ///< smallest relative pivot of the loops' elimination: 0 where they lose rank
  double misfit = 0;  ///< loop velocity that the drives' rates leave open, relative: 0 unless they are dependent
};

/// Linear relations between the rates of passive coordinates and drives, factorised once per configuration.
class LoopRates {
 public:
  explicit LoopRates(const Mechanism& m);

  /// At frames of a closed configuration.
  void factorise(const Mechanism& m, const Frames& frames);
  /// Passive rates (all coordinates, zero elsewhere) with drives at rest that give the loops the
  /// relative velocity `e` (one column per case), least squares of least norm.
  void solve(const Mechanism& m, const MatX& e, Eigen::Ref<MatX> out) const;
  void motion(const Mechanism& m, const Frames& frames, Motion& out) const;

 private:
  MatX solve_scaled(const MatX& e) const;
  MatX product(const MatX& x) const;
  MatX transposed_product(const MatX& e) const;
  double fill_normal();

  RigidTree tree_;
  std::vector<Index> passive_;
  std::vector<std::vector<Index>> columns_;  ///< per loop: passive columns that are not zero
  MatX J_, A_, N_;
  double pivot_ = 1;
  bool regular_ = true;
  Cholesky cholesky_;
  Orthogonal orthogonal_;
};

}  // namespace stiffmap
