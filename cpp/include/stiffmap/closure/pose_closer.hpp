// SPDX-License-Identifier: MIT
// Closing a machine at many neighbouring poses, springs at rest.
#pragma once

#include <vector>

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/closure/closure.hpp"
#include "stiffmap/kinematics/rigid_tree.hpp"

namespace stiffmap {

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
  bool newton(const Mechanism& m, const Pose& pose, VecX& x, bool passed = false);
  bool close_nearest(const Mechanism& m, const Pose& pose, VecX& x);  ///< of a redundant machine
  void normal(const Mechanism& m, const Pose& pose);
  bool continued(const Mechanism& m, const Pose& from, const Pose& pose, VecX& x);
  bool from_there(const Mechanism& m, const Pose& pose, VecX& x);
  bool from_home(const Mechanism& m, const Pose& pose, VecX& x);
  void at_rest(const Mechanism& m, VecX& x) const;
  ClosureResult answer(const Mechanism& m, const Pose& pose, VecX& x, bool ok, ClosureResult out);
  void remember(const Pose& pose, const VecX& x);
  bool extrapolated(const Pose& pose, VecX& x) const;
  double residual(const Mechanism& m, const Pose& pose, const VecX& x);

  ClosureWorkspace ws_;
  RigidTree tree_;
  std::vector<std::vector<Index>> columns_;  ///< of the unknowns: columns of the tip's and of each loop's rows
  MatX A_, N_;
  VecX e_, right_, unit_, last_, trial_;
  Cholesky cholesky_;
  double first_step_ = 0;  ///< of Newton's last search, over the length
  Pose last_pose_;
  bool has_last_ = false;
  // the poses before the last, while they are evenly spaced along a line
  VecX before_, earlier_;
  Vec3 step_ = Vec3::Zero();
  int even_ = 0;
};

}  // namespace stiffmap
