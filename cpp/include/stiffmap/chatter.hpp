// SPDX-License-Identifier: MIT
// Stability of milling: the largest multiplier of one tooth period by semi-discretization (theory V5).
#pragma once

#include <cstddef>
#include <vector>

#include "stiffmap/types.hpp"

namespace stiffmap {

using Chip = Eigen::Matrix<double, 3, 2>;  ///< N/m per m of depth: force by what two passes differ by, feed and normal

/// What vibrates at the tool, in the axes feed, normal, tool axis.
struct ToolModes {
  VecX omega, ratio, mass;                       ///< rad/s, share of critical damping, kg
  Eigen::Matrix<double, 3, Eigen::Dynamic> way;  ///< unit vector of each
  Mat3 rest = Mat3::Zero();                      ///< m/N that follows the force at once
};

/// Scratch of `largest_multiplier`.
struct ChatterWorkspace {
  std::vector<double> step;  ///< per interval, by rows: state by state and by what the last pass left
  std::vector<double> state, term, next;
  std::vector<Chip> gain;
  MatX basis, hessenberg;
  VecX start;                  ///< where the next search begins: near what the last one found
  std::vector<double> passed;  ///< displacements of two periods, the oldest first
  double settled = 1e-10;      ///< residual of the largest multiplier, relative
};

/// |mu| of the largest multiplier; `chips`: means over the equal intervals of a tooth period (s), depth in m.
double largest_multiplier(const ToolModes& modes, const std::vector<Chip>& chips, double period, double depth,
                          ChatterWorkspace& ws);

}  // namespace stiffmap
