// SPDX-License-Identifier: MIT
// Virtual springs of links: 6x6 matrices, their checks and the beam that most users start from.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "stiffmap/algebra/types.hpp"

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

/// How a link's compliance varies with a joint's coordinate u, taken where the pose is commanded (theory S3):
/// a beam that is `length` long at u = `at` and grows by `rate` per unit of u, or a table that is linear between
/// its rows (u, compliance).
struct Stroke {
  std::string joint;  ///< its name in the sequence of the spring, or in one around it
  int along = 0;      ///< axis of the beam: 0, 1, 2
  double at = 0, length = 0, rate = 0;
  std::vector<std::pair<double, Mat6>> table;  ///< empty: a beam

  /// The table's ends are taken with this share of its width on top: commands have round-off.
  static constexpr double slack = 1e-9;
};

/// Exponent of the beam's length in entry (i, j) of its compliance: 1, 2 or 3.
inline int stroke_power(int along, int i, int j) { return 1 + (i < 3 && i != along) + (j < 3 && j != along); }

/// Refuses tables that do not rise, and rows that are not regular where `matrix` is.
void check_stroke(const Stroke& stroke, const SpringMatrix& matrix, const std::string& name);

/// Stiffness at u of a spring that is `matrix` where the stroke counts from; false where no compliance is declared.
bool stiffness_at(const Stroke& stroke, const SpringMatrix& matrix, double u, Mat6& stiffness);

}  // namespace stiffmap
