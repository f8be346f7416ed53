// SPDX-License-Identifier: MIT
// Stability of milling: the largest multiplier of one tooth period by semi-discretization (theory V5).
#pragma once

#include <vector>

#include "stiffmap/types.hpp"

namespace stiffmap {

using Chip = Eigen::Matrix<double, 3, 2>;  ///< N/m per m of depth: force by what two passes differ by, feed and normal

/// What vibrates at the tool, in the axes feed, normal, tool axis.
struct ToolModes {
  VecX omega, ratio, mass;  ///< rad/s, share of critical damping, kg
  Eigen::Matrix<double, 3, Eigen::Dynamic> way;  ///< unit vector of each
  Mat3 rest = Mat3::Zero();  ///< m/N that follows the force at once
};

/// Scratch of `largest_multiplier`.
struct ChatterWorkspace {
  std::vector<MatX> step, push;  ///< per interval: state by state, state by what the last pass left
  std::vector<Chip> gain;
  MatX basis, hessenberg, work;
  VecX start;
  std::vector<Eigen::Vector2d> passed;
};

/// |mu| of the largest multiplier; `chips`: means over the equal intervals of a tooth period (s), depth in m.
double largest_multiplier(const ToolModes& modes, const std::vector<Chip>& chips, double period, double depth,
                          ChatterWorkspace& ws);

}  // namespace stiffmap
