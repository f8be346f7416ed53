// SPDX-License-Identifier: MIT
// First-order kinematics of a closed machine: rates of all coordinates and of the tip per drive rate,
// springs at rest (theory D1-D3).
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <array>
#include <vector>

#include "stiffmap/closure.hpp"

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

/// The joints alone: springs at rest, locked coordinates at home, the constant transforms between joints multiplied.
class RigidTree {
 public:
  explicit RigidTree(const Mechanism& m);

  /// Frames of moving joints, of the tip and of the loops' ends; axes and origins of moving joints. Others stay.
  void forward(const VecX& x, Frames& out) const;
  /// Drives and free passive coordinates.
  const std::vector<Index>& moving() const { return moving_; }
  /// Those that move the tip, from the base outwards.
  const std::vector<Index>& tip() const { return tip_; }
  /// Those that move one end of a loop and not the other: primary and end.
  const std::array<std::vector<Index>, 2>& loop(std::size_t l) const { return loops_[l]; }

 private:
  struct Step {
    Index node, parent, coordinate;
    JointType type;
    Pose before;
    Vec3 axis;
  };
  std::vector<Step> steps_;
  std::vector<Index> moving_, tip_;
  std::vector<std::array<std::vector<Index>, 2>> loops_;
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
  Eigen::LLT<MatX> llt_;
  Eigen::CompleteOrthogonalDecomposition<MatX> cod_;
};

/// Closes many neighbouring poses: Newton from a given start or from the last pose, else by continuation
/// from home. Frames are those of `RigidTree`.
class PoseCloser {
 public:
  explicit PoseCloser(const Mechanism& m);

  /// `x`: start (NaN: none) in, closed coordinates out. Frames of the answer are in `frames()`. Impatient:
  /// a pose that a straight continuation from home does not reach counts as out of reach.
  ClosureResult close(const Mechanism& m, const Pose& pose, VecX& x, bool patient = true);
  /// From closed coordinates `x` of a neighbouring pose and nowhere else, so that the answer continues them.
  ClosureResult continue_from(const Mechanism& m, const Pose& pose, VecX& x);
  const Frames& frames() const { return ws_.frames; }
  /// Of the equations at the closed pose: the smallest pivot relative to the largest, unpivoted.
  double pivot(const Mechanism& m, const Pose& pose);

 private:
  bool newton(const Mechanism& m, const Pose& pose, VecX& x);
  void normal(const Mechanism& m, const Pose& pose);
  bool continued(const Mechanism& m, const Pose& from, const Pose& pose, double shortest, VecX& x);
  bool from_home(const Mechanism& m, const Pose& pose, VecX& x);
  void at_rest(const Mechanism& m, VecX& x) const;
  ClosureResult answer(const Mechanism& m, const Pose& pose, const VecX& x, bool ok, ClosureResult out);
  void remember(const Pose& pose, const VecX& x);
  bool extrapolated(const Pose& pose, VecX& x) const;
  double residual(const Mechanism& m, const Pose& pose, const VecX& x);

  ClosureWorkspace ws_;
  RigidTree tree_;
  std::vector<std::vector<Index>> columns_;  ///< of the unknowns: columns of the tip's and of each loop's rows
  MatX A_, N_;
  VecX e_, right_, unit_, last_, trial_;
  Eigen::LLT<MatX> llt_;
  Pose last_pose_;
  bool has_last_ = false;
  // the poses before the last, while they are evenly spaced along a line
  VecX before_, earlier_;
  Vec3 step_ = Vec3::Zero();
  int even_ = 0;
};

}  // namespace stiffmap
