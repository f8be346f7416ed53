// SPDX-License-Identifier: MIT
// Stiffness of a point at an equilibrium: equation (25) of the paper, theory (K1), and what its rank says.
#pragma once

#include "stiffmap/stiffness/saddle.hpp"

namespace stiffmap {

struct StiffnessResult {
  Mat6 stiffness, compliance;  ///< compliance is NaN where a twist is free
  Mat6 free_twists;            ///< columns; NaN beyond the last
  int free = 0;                ///< number of free twists
  std::uint32_t flags = 0;
};

/// Scratch of one thread.
struct StiffnessWorkspace {
  explicit StiffnessWorkspace(const Mechanism& m);
  MatX J, K, Jt, Hq, B, M, X, sub;
  std::vector<Index> theta, q;
  Lu lu_theta, lu;
};

/// Stiffness and compliance of point `offset` of `node` between a small extra dead wrench at the point
/// and a small extra twist, base axes.
StiffnessResult point_stiffness(const Mechanism& m, const Linearization& lin, const SaddleSystem& saddle, Index node,
                                const Vec3& offset, StiffnessWorkspace& ws);

/// Where no stiffness was found by (K1): the same from the compliance C of the force-driven tangent. RIGID_DIRECTION
/// stays where C, free of noise, has a direction without motion.
void by_compliance(const Mechanism& m, const Mat6& C, bool regular, StiffnessResult& out);

}  // namespace stiffmap
