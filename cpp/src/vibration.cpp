// SPDX-License-Identifier: MIT
#include "stiffmap/vibration.hpp"

#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double no_mass = 1e-13;    // relative to the largest inverse square of a frequency
constexpr double no_damper = 1e-12;  // relative to the largest damping of a motion without mass

/// Columns of X without mass, turned so that those with dampers come first; their number.
Index damped_first(const MatX& D, MatX& X) {
  if (X.cols() == 0 || D.isZero(0)) return 0;
  const EigenX found = symmetric_eigen(MatX(X.transpose() * D * X));
  const double largest = found.values[X.cols() - 1];
  if (!(largest > 0)) return 0;
  X = (X * found.vectors.rowwise().reverse()).eval();
  return (found.values.array() > no_damper * largest).count();
}

}  // namespace

void tip_modes(const Mechanism& m, const Inertias& inertias, const Damping& damping, const PoseInput& in, Index count,
               SolveWorkspace& ws, VibrationResult& out) {
  out.kept = 0;
  out.square.setConstant(count, nan);
  out.tip.setConstant(6, count, nan);
  out.viscous.setConstant(count, count, nan);
  out.loss.setConstant(count, count, nan);
  out.rest.setConstant(nan);
  out.unsymmetric = nan;
  ReducedPose pose;
  const bool found = reduced_pose(m, inertias, in, ws, pose);
  out.status = pose.status;
  out.flags = pose.flags;
  if (!found) return;
  out.rest.setZero();
  out.unsymmetric = 0;
  const Index n = pose.K.rows();
  if (n == 0) return;  // nothing moves
  out.unsymmetric = (pose.K - pose.K.transpose()).norm() / pose.S.norm();
  const Linearization& lin = ws.equilibrium.lin;

  MatX lower = pose.M;  // L^-1 M L'^-1 of S = L L'
  pose.cholesky.solve_lower(lower);
  MatX inverse_square = lower.transpose();
  pose.cholesky.solve_lower(inverse_square);
  EigenX modes = symmetric_eigen(MatX(0.5 * (inverse_square + inverse_square.transpose())));
  pose.cholesky.solve_upper(modes.vectors);
  MatX X = pose.Z * modes.vectors.rowwise().reverse();  // unit stiffness, lowest frequency first
  VecX mu = modes.values.reverse();
  const Index massive = (mu.array() > no_mass * std::max(mu[0], 0.0)).count();

  const VecX root = damping.loss.cwiseSqrt();
  const MatX lossy = root.asDiagonal() * springs_only(m, lin) * root.asDiagonal();
  const MatX both = lossy + MatX(damping.viscous.asDiagonal());
  MatX still = X.rightCols(n - massive);
  const Index damped = damped_first(both, still);
  X.rightCols(n - massive) = still;
  mu.tail(n - massive).setZero();

  MatX jacobian(6, m.size());
  lin.point_jacobian(m, in.load_points.front().node, in.load_points.front().offset, jacobian);
  const MatX tip = jacobian * X;
  out.kept = std::min(count, massive + damped);
  const Index k = out.kept;
  out.square.head(k) = mu.head(k);
  out.tip.leftCols(k) = tip.leftCols(k);
  const MatX kept = X.leftCols(k);
  out.viscous.topLeftCorner(k, k) = kept.transpose() * damping.viscous.asDiagonal() * kept;
  out.loss.topLeftCorner(k, k) = kept.transpose() * lossy * kept;
  out.rest = tip.rightCols(n - k) * tip.rightCols(n - k).transpose();
}

}  // namespace stiffmap
