// SPDX-License-Identifier: MIT
#include "stiffmap/model/spring.hpp"

#include <cmath>

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/common/check.hpp"

namespace stiffmap {
namespace {

/// Scaling that makes the diagonal one: rank and sign decisions must not depend on units.
Vec6 unit_diagonal(const Mat6& M) {
  Vec6 s;
  for (int i = 0; i < 6; ++i) s[i] = M(i, i) > 0 ? 1 / std::sqrt(M(i, i)) : 0.0;
  return s;
}

void check_symmetric_psd(const Mat6& M, const std::string& name) {
  require(M.allFinite(), name, "finite numbers", "NaN or infinity");
  for (int i = 0; i < 6; ++i) require(M(i, i) >= 0, name, "a positive semidefinite 6x6 matrix", M(i, i));
  const Vec6 s = unit_diagonal(M);
  const Mat6 N = s.asDiagonal() * M * s.asDiagonal();
  require((N - N.transpose()).cwiseAbs().maxCoeff() < 1e-9, name, "a symmetric 6x6 matrix; max |M - M^T| must vanish",
          (M - M.transpose()).cwiseAbs().maxCoeff());
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j)
      require(M(i, j) == 0 || (s[i] > 0 && s[j] > 0), name, "a positive semidefinite 6x6 matrix",
              "a coupling to a zero diagonal entry");
  const double lowest = symmetric_eigen(N).values[0];
  require(lowest > -1e-9, name, "a positive semidefinite 6x6 matrix; lowest scaled eigenvalue >= 0", lowest);
}

}  // namespace

SpringMatrix spring_from_stiffness(const Mat6& K, const std::string& name) {
  check_symmetric_psd(K, name);
  SpringMatrix out;
  out.stiffness = 0.5 * (K + K.transpose());
  return out;
}

SpringMatrix spring_from_compliance(const Mat6& C, const std::string& name) {
  check_symmetric_psd(C, name);
  const Vec6 s = unit_diagonal(C);
  const Mat6 N = 0.5 * (s.asDiagonal() * (C + C.transpose()) * s.asDiagonal());
  SpringMatrix out;
  // Directions with a zero diagonal are rigid as they stand; the rest may hide a rank defect.
  const Eigen6 eigen = symmetric_eigen(N);
  int rank = 0, moving = 0;
  for (int i = 0; i < 6; ++i) {
    rank += eigen.values[i] > 1e-9;
    moving += s[i] > 0;
  }
  if (rank == moving) {
    for (int i = 0; i < 6; ++i) out.rigid[i] = s[i] == 0;
    Mat6 full = N;
    for (int i = 0; i < 6; ++i)
      if (out.rigid[i]) full(i, i) = 1;
    Mat6 K = inverse(full);
    for (int i = 0; i < 6; ++i)
      if (out.rigid[i]) K(i, i) = 0;
    out.stiffness = s.asDiagonal() * K * s.asDiagonal();
    out.stiffness = (0.5 * (out.stiffness + out.stiffness.transpose())).eval();
    return out;
  }
  const Eigen6 plain = symmetric_eigen(Mat6(0.5 * (C + C.transpose())));
  out.basis = plain.vectors;
  out.rotated = true;
  for (int i = 0; i < 6; ++i) {
    const double c = plain.values[i];
    out.rigid[i] = c < 1e-9 * plain.values[5];
    out.stiffness(i, i) = out.rigid[i] ? 0 : 1 / c;
  }
  return out;
}

void check_stroke(const Stroke& stroke, const SpringMatrix& matrix, const std::string& name) {
  require(!stroke.joint.empty(), name + ".stroke", "a joint's name", "none");
  require(!matrix.rotated, name + ".stroke", "a compliance without a hidden rank defect", "one");
  if (stroke.table.empty()) {
    require(stroke.length > 0, name + ".stroke", "a positive length", stroke.length);
    return;
  }
  require(stroke.table.size() > 1, name + ".stroke", "two rows or more", stroke.table.size());
  for (std::size_t k = 0; k < stroke.table.size(); ++k) {
    const auto& [u, C] = stroke.table[k];
    if (k) require(u > stroke.table[k - 1].first, name + ".stroke", "rising coordinates", u);
    const SpringMatrix row = spring_from_compliance(C, name + ".stroke");
    require(!row.rotated && (row.rigid == matrix.rigid).all(), name + ".stroke",
            "the same rigid directions in every row, and no hidden ones", "row " + std::to_string(k + 1));
  }
}

bool stiffness_at(const Stroke& stroke, const SpringMatrix& matrix, double u, Mat6& stiffness) {
  if (stroke.table.empty()) {
    const double longer = 1 + stroke.rate * (u - stroke.at) / stroke.length;
    if (!(longer > 0)) return false;
    const double power[] = {1 / longer, 1 / (longer * longer), 1 / (longer * longer * longer)};
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k < 6; ++k)
        stiffness(i, k) = matrix.stiffness(i, k) * power[stroke_power(stroke.along, i, k) - 1];
    return true;
  }
  const auto& rows = stroke.table;
  const double slack = Stroke::slack * (rows.back().first - rows.front().first);
  if (!(u >= rows.front().first - slack && u <= rows.back().first + slack)) return false;
  std::size_t k = 0;
  while (k + 2 < rows.size() && u >= rows[k + 1].first) ++k;
  const double share = (u - rows[k].first) / (rows[k + 1].first - rows[k].first);
  Mat6 C = (1 - share) * rows[k].second + share * rows[k + 1].second;
  for (int i = 0; i < 6; ++i)
    if (matrix.rigid[i]) C(i, i) = 1;
  const Vec6 s = unit_diagonal(C);
  stiffness = s.asDiagonal() * inverse(Mat6(s.asDiagonal() * C * s.asDiagonal())) * s.asDiagonal();
  stiffness = (0.5 * (stiffness + stiffness.transpose())).eval();
  for (int i = 0; i < 6; ++i)
    if (matrix.rigid[i]) stiffness(i, i) = 0;
  return true;
}

}  // namespace stiffmap
