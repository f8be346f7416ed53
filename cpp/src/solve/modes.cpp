// SPDX-License-Identifier: MIT
#include "stiffmap/solve/modes.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stiffmap/stiffness/stability.hpp"

namespace stiffmap {
namespace {

constexpr double no_mass = 1e-13;      // relative to the largest inverse square of a frequency
constexpr double no_damper = 1e-12;    // relative to the largest damping of a motion without mass
constexpr double gap_at_rest = 1e-12;  // a gap of the loops, of the length: at rest without forces
constexpr double negligible = 1e-9;    // of a tangent and of its eigenvalues, relative

/// Motions that keep all loops closed, their tangent and mass.
struct Reduced {
  MatX Z;             ///< coordinates x motions
  MatX K, S, M;       ///< tangent, its symmetric part, mass
  Cholesky cholesky;  ///< of S
};

/// False where there is no equilibrium, or none that a small motion comes back to.
bool reduced_pose(const Mechanism& m, const Inertias& inertias, const PoseInput& in, SolveWorkspace& ws, Reduced& out,
                  ModesResult& found) {
  const ClosureResult closure = prepare_pose(m, in, ws);
  found.status = closure.status;
  found.flags = closure.flags;
  if (closure.status != Status::converged) return false;
  const Linearization& lin = ws.equilibrium.lin;
  linearize(m, ws.problem, ws.state, ws.equilibrium.lin);
  const bool at_rest = !m.floating && !has_knots(m) && lin.r.isZero(0) && lin.e.norm() < gap_at_rest * m.length;
  if (!at_rest) {
    const EquilibriumResult eq = solve_equilibrium(m, ws.problem, {}, ws.equilibrium, ws.state);
    found.status = eq.status;
    found.flags |= eq.flags;
    if (eq.status != Status::converged) return false;
  }
  found.x = lin.x;
  out.Z = closed_motions(m, lin);
  out.K = reduced_tangent(m, lin, out.Z);
  out.M = congruent(coordinate_mass(m, inertias, lin.frames), out.Z);
  out.S = 0.5 * (out.K + out.K.transpose());
  if (out.K.rows() == 0) return true;
  const bool definite = out.cholesky.compute(out.S);
  const VecX pivots = out.cholesky.pivots();
  const bool sound = definite && pivots.cwiseAbs2().minCoeff() > 1e-13 * out.S.diagonal().cwiseAbs().maxCoeff();
  if (sound || out.M.isZero(0)) return true;
  const VecX values = symmetric_eigen(out.S).values;
  const double low = values[0], high = values[out.K.rows() - 1];
  if (low > 1e-12 * high) return true;
  found.status = low < -1e-9 * high ? Status::unstable : Status::singular;
  return false;
}

/// Inverse squares of frequencies, ascending, and modes of unit stiffness, of a tangent as it is; false: complex, which
/// is flutter.
bool unsymmetric(const Reduced& pose, EigenX& out) {
  Lu lu(pose.K.rows());
  lu.compute(pose.K);
  MatX A;
  lu.solve(pose.M, A);
  const auto [values, all] = general_eigen(A);
  const double largest = negligible * values.cwiseAbs().maxCoeff();
  if ((values.imag().array().abs() > largest).any() || (values.real().array() < -largest).any()) return false;
  std::vector<Index> order(at(values.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(),
            [&values = values](Index a, Index b) { return values[a].real() < values[b].real(); });
  out.values = values(order).real();
  out.vectors = all(Eigen::indexing::all, order).real();
  for (Index k = 0; k < out.values.size(); ++k) {
    const double modal = out.vectors.col(k).dot(pose.M * out.vectors.col(k));
    out.vectors.col(k) *= std::sqrt(std::max(out.values[k], 0.0) / std::max(modal, 1e-300));
  }
  return true;
}

/// The same of the symmetric part S = L L': of L^-1 M L'^-1.
EigenX symmetric(const Reduced& pose) {
  MatX lower = pose.M;
  pose.cholesky.solve_lower(lower);
  MatX inverse_square = lower.transpose();
  pose.cholesky.solve_lower(inverse_square);
  EigenX found = symmetric_eigen(MatX(0.5 * (inverse_square + inverse_square.transpose())));
  pose.cholesky.solve_upper(found.vectors);
  return found;
}

/// Columns of X without mass, turned so that those with dampers come first; their number.
Index damped_first(const MatX& D, MatX& X) {
  if (X.cols() == 0 || D.isZero(0)) return 0;
  const EigenX found = symmetric_eigen(congruent(D, X));
  const double largest = found.values[X.cols() - 1];
  if (!(largest > 0)) return 0;
  X = (X * found.vectors.rowwise().reverse()).eval();
  return (found.values.array() > no_damper * largest).count();
}

}  // namespace

void lowest_modes(const Mechanism& m, const Inertias& inertias, const Damping& damping, const PoseInput& in,
                  Index count, bool whole, SolveWorkspace& ws, ModesResult& out) {
  out.kept = 0;
  out.x.setConstant(m.size(), nan);
  out.square.setConstant(count, nan);
  out.shape.setConstant(m.size(), count, nan);
  out.tip.setConstant(6, count, nan);
  out.viscous.setConstant(count, count, nan);
  out.loss.setConstant(count, count, nan);
  out.rest.setConstant(nan);
  out.unsymmetric = nan;
  Reduced pose;
  if (!reduced_pose(m, inertias, in, ws, pose, out)) return;
  out.rest.setZero();
  out.unsymmetric = 0;
  const Index n = pose.K.rows();
  if (n == 0) return;  // nothing moves
  out.unsymmetric = (pose.K - pose.K.transpose()).norm() / pose.S.norm();
  const Linearization& lin = ws.equilibrium.lin;
  EigenX modes;
  if (!whole || out.unsymmetric <= negligible) modes = symmetric(pose);
  else if (!unsymmetric(pose, modes)) {
    out.status = Status::unstable;
    return;
  }
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
  out.shape.leftCols(k) = X.leftCols(k);
  out.tip.leftCols(k) = tip.leftCols(k);
  const MatX kept = X.leftCols(k);
  out.viscous.topLeftCorner(k, k) = kept.transpose() * damping.viscous.asDiagonal() * kept;
  out.loss.topLeftCorner(k, k) = congruent(lossy, kept);
  out.rest = tip.rightCols(n - k) * tip.rightCols(n - k).transpose();
}

}  // namespace stiffmap
