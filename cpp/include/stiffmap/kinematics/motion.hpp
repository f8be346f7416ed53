// SPDX-License-Identifier: MIT
// First-order kinematics of a closed machine: rates of all coordinates and of the tip per drive rate,
// springs at rest (theory D1-D3).
#pragma once

#include <vector>

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/kinematics/rigid_tree.hpp"

namespace stiffmap {

using Mat6X = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Rates at one configuration.
///
/// Where drives outnumber the freedoms (two on one axis), only some rates of theirs go together. `sharing` holds them:
/// it takes any rates to the nearest ones that do, and efforts that the motion needs to the drives' shares of them
/// (D10).
struct Motion {
  MatX sharing;        ///< drives x drives; the identity where all rates are possible
  MatX rates;          ///< coordinates x drives; rate of every coordinate per unit rate of a drive
  Mat6X J;             ///< tip twist per unit rate of a drive, base axes
  Vec6 free_twist;     ///< of the tip, with all drives held; NaN where there is none
  double pivot = 1;    ///< smallest relative pivot of the loops' elimination: 0 where they lose rank
  Index together = 0;  ///< dimension of the rates of drives that go together
};

/// Linear relations between the rates of passive coordinates and drives, factorised once per configuration.
class LoopRates {
 public:
  explicit LoopRates(const Mechanism& m);

  /// At frames of a closed configuration.
  void factorise(const Mechanism& m, const Frames& frames);
  /// Rates (all coordinates) that give the loops the relative velocity `e` (one column per case), least squares of
  /// least norm: of passive joints, and of drives where there are more than freedoms and passive joints do not suffice.
  void solve(const Mechanism& m, const MatX& e, Eigen::Ref<MatX> out) const;
  /// `weights`: of the drives, positive, such as their stiffnesses: what is nearest; empty: angles as lengths.
  void motion(const Mechanism& m, const Frames& frames, Motion& out, const VecX& weights = {}) const;

 private:
  MatX driven(const Mechanism& m) const;
  MatX solve_scaled(const MatX& e) const;
  double fill_normal();
  void share(const Mechanism& m, const MatX& open, const VecX& weights, Motion& out) const;

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
