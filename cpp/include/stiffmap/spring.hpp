// SPDX-License-Identifier: MIT
// Virtual springs of links: 6x6 matrices, their checks and the beam that most users start from.
#pragma once

#include <string>

#include "stiffmap/types.hpp"

namespace stiffmap {

/// A coupled 6x6 spring in coordinates theta' = basis^T theta, where `stiffness` is its matrix and
/// the directions marked `rigid` have none (a null direction of a compliance).
struct SpringMatrix {
  Mat6 stiffness = Mat6::Zero();
  Mat6 basis = Mat6::Identity();
  Eigen::Array<bool, 6, 1> rigid = Eigen::Array<bool, 6, 1>::Constant(false);
  bool rotated = false;  ///< basis differs from the identity
};

/// Symmetric positive semidefinite stiffness (null directions are free).
SpringMatrix spring_from_stiffness(const Mat6& stiffness, const std::string& name);

/// Symmetric positive semidefinite compliance (null directions are rigid).
SpringMatrix spring_from_compliance(const Mat6& compliance, const std::string& name);

/// Section and material of a straight prismatic beam along local x (SI).
struct BeamSection {
  double EA, EIy, EIz, GJ;
};

/// Compliance of the free end of an Euler-Bernoulli cantilever along x, theory (S1).
Mat6 beam_compliance(double length, const BeamSection& section);

}  // namespace stiffmap
