// SPDX-License-Identifier: MIT
// The inverse problem, eq. (10) of the paper: an imposed platform displacement instead of a wrench. The
// point is closed against an imposed pose like the end of one more leg; the multiplier of that loop is
// the wrench that holds it. Defined also where the force-driven problem is not.
#pragma once

#include "stiffmap/solve/solve.hpp"

namespace stiffmap {

struct ClampResult {
  Status status = Status::unreachable;  ///< with the point held
  std::uint32_t flags = 0;
  Vec6 wrench;                      ///< that holds the machine at the point, base axes; NaN where rigid
                                    ///< parts leave a component open
  std::vector<Mat6> leg_stiffness;  ///< imposed twist of the point to minus the leg's wrench there
  PoseResult pose;                  ///< the same equilibrium under that wrench as a dead load
};

/// A machine with one point held; one per thread, since the imposed pose is one of its frames.
class Clamp {
 public:
  Clamp(const Mechanism& machine, Index point);

  /// Holds the point at `displacement` (translation, rotation vector) from the commanded pose, under the
  /// loads of `in`. Never throws for a pose.
  void solve(PoseInput in, const Vec6& displacement, ClampResult& out);

 private:
  const Mechanism& machine_;
  NodePoint point_;
  Mechanism held_;  ///< the machine, a frame at the imposed pose, and the loop between them
  std::size_t frame_ = 0;
  SolveWorkspace ws_;  ///< of the machine
  EquilibriumWorkspace eq_;
  State state_, before_;

  bool hold(const Pose& pose, Problem& problem);
  bool follow(const Vec6& displacement, Problem& problem);
  void leg_stiffness(ClampResult& out);
  void hide_undetermined(ClampResult& out);
};

}  // namespace stiffmap
