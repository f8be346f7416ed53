// SPDX-License-Identifier: MIT
// Stability of milling: the largest multiplier of one tooth period by semi-discretization (theory V5).
#pragma once

#include <vector>

#include "stiffmap/common/answers.hpp"

namespace stiffmap {

using Chip = Eigen::Matrix<double, 3, 2>;  ///< N/m per m of depth: force by what two passes differ by, feed and normal

/// What vibrates at the tool, in the axes feed, normal, tool axis.
struct ToolModes {
  VecX omega, ratio, mass;                       ///< rad/s, share of critical damping, kg
  Eigen::Matrix<double, 3, Eigen::Dynamic> way;  ///< unit vector of each
  Mat3 rest = Mat3::Zero();                      ///< m/N that follows the force at once
};

/// |mu| of the largest multiplier at depths (m); `chips`: means over the equal intervals of a tooth period (s).
VecX largest_multipliers(const ToolModes& modes, const std::vector<Chip>& chips, double period, const VecX& depths);

/// The same of many tooth periods: "multipliers", periods x depths.
Answers largest_multipliers(const ToolModes& modes, const std::vector<Chip>& chips, const VecX& periods,
                            const VecX& depths, int threads);

}  // namespace stiffmap
