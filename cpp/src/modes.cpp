// SPDX-License-Identifier: MIT
#include "stiffmap/modes.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace stiffmap {
namespace {

constexpr double massless = 1e-13;  // relative to the largest inverse square of a frequency

/// Columns: motions that springs, laws and joints allow before the loops are closed, as lengths.
MatX allowed(const Mechanism& m, const Linearization& lin) {
  const Index n = m.size();
  MatX out = MatX::Zero(n, n);
  Index used = 0;
  std::vector<bool> done(at(n), false);
  for (const SpringGroup& g : m.groups) {
    if (!g.matrix.rotated) continue;
    for (int i = 0; i < 6; ++i) {
      done[at(g.first + i)] = true;
      if (g.matrix.rigid[i]) continue;
      out.col(used++).segment<6>(g.first) = g.matrix.basis.col(i);
    }
  }
  for (Index j = 0; j < n; ++j)
    if (!done[at(j)] && lin.kind[at(j)] != Kind::fixed) out(j, used++) = 1 / m.unit(j);
  return out.leftCols(used);
}

/// Of those, the motions that keep every loop closed.
MatX closed_motions(const Mechanism& m, const Linearization& lin) {
  const MatX P = allowed(m, lin);
  if (m.closures() == 0) return P;
  MatX C = lin.J * P;
  scale_angles(m, C);
  return P * left_null_vectors(C.transpose(), rank_threshold);
}

MatX tangent(const Mechanism& m, const Linearization& lin) { return springs_only(m, lin) - lin.H; }

void keep(const MatX& Z, const VecX& inverse_square, const MatX& vectors, ModesResult& out) {
  const double largest = std::max(inverse_square.cwiseAbs().maxCoeff(), 0.0);
  const Index count = out.square.size();
  for (Index k = 0; k < std::min<Index>(count, inverse_square.size()); ++k) {
    const double mu = inverse_square[inverse_square.size() - 1 - k];
    if (!(mu > massless * largest)) break;
    out.square[k] = 1 / mu;
    out.shape.col(k) = Z * vectors.col(vectors.cols() - 1 - k) / std::sqrt(mu);
  }
}

/// A tangent that dead moments make unsymmetric: complex frequencies are flutter.
bool unsymmetric(const MatX& Z, const MatX& K, const MatX& M, ModesResult& out) {
  Lu lu(K.rows());
  lu.compute(K);
  MatX A;
  lu.solve(M, A);
  const auto [values, all] = general_eigen(A);
  std::vector<Index> order(at(values.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(),
            [&values = values](Index a, Index b) { return values[a].real() < values[b].real(); });
  const double largest = values.cwiseAbs().maxCoeff();
  VecX mu(values.size());
  MatX vectors(K.rows(), values.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    const Index j = order[k];
    if (std::abs(values[j].imag()) > 1e-9 * largest || values[j].real() < -1e-9 * largest) return false;
    const VecX v = all.col(j).real();
    mu[static_cast<Index>(k)] = values[j].real();
    const double modal = v.dot(M * v);
    vectors.col(static_cast<Index>(k)) =
        v * std::sqrt(std::max(mu[static_cast<Index>(k)], 0.0) / std::max(modal, 1e-300));
  }
  keep(Z, mu, vectors, out);
  return true;
}

}  // namespace

bool reduced_pose(const Mechanism& m, const Inertias& inertias, const PoseInput& in, SolveWorkspace& ws,
                  ReducedPose& out) {
  const ClosureResult closure = prepare_pose(m, in, ws);
  out.status = closure.status;
  out.flags = closure.flags;
  if (closure.status != Status::converged) return false;
  const EquilibriumResult eq = solve_equilibrium(m, ws.problem, {}, ws.equilibrium, ws.state);
  out.status = eq.status;
  out.flags |= eq.flags;
  if (eq.status != Status::converged) return false;
  const Linearization& lin = ws.equilibrium.lin;
  out.x = lin.x;
  out.Z = closed_motions(m, lin);
  out.K = out.Z.transpose() * tangent(m, lin) * out.Z;
  out.M = out.Z.transpose() * coordinate_mass(m, inertias, lin.frames) * out.Z;
  out.S = 0.5 * (out.K + out.K.transpose());
  if (out.K.rows() == 0) return true;
  const bool definite = out.cholesky.compute(out.S);
  const VecX pivots = out.cholesky.pivots();
  const bool sound = definite && pivots.cwiseAbs2().minCoeff() > 1e-13 * out.S.diagonal().cwiseAbs().maxCoeff();
  if (sound || out.M.isZero(0)) return true;
  const VecX values = symmetric_eigen(out.S).values;
  const double low = values[0], high = values[out.K.rows() - 1];
  if (low > 1e-12 * high) return true;
  out.status = low < -1e-9 * high ? Status::unstable : Status::singular;
  return false;
}

MatX springs_only(const Mechanism& m, const Linearization& lin) {
  MatX out = lin.K;
  for (Index j = 0; j < m.size(); ++j)
    if (m.coordinates[at(j)].law >= 0 && lin.da[j] != 0) out(j, j) += lin.dtau[j] / lin.da[j];
  return out;
}

void natural_modes(const Mechanism& m, const Inertias& inertias, const PoseInput& in, Index count, SolveWorkspace& ws,
                   ModesResult& out) {
  out.square.setConstant(count, nan);
  out.shape.setConstant(m.size(), count, nan);
  out.x.setConstant(m.size(), nan);
  ReducedPose pose;
  const bool found = reduced_pose(m, inertias, in, ws, pose);
  out.status = pose.status;
  out.flags = pose.flags;
  if (!found) return;
  out.x = pose.x;
  const MatX &Z = pose.Z, &K = pose.K, &M = pose.M;
  if (K.rows() == 0 || M.isZero(0)) return;  // nothing moves, or nothing has mass
  if ((K - K.transpose()).norm() > 1e-9 * pose.S.norm()) {
    if (!unsymmetric(Z, K, M, out)) out.status = Status::unstable;
    return;
  }
  MatX X = M;
  pose.cholesky.solve_lower(X);
  MatX reduced = X.transpose();
  pose.cholesky.solve_lower(reduced);
  EigenX modes = symmetric_eigen(MatX(0.5 * (reduced + reduced.transpose())));
  pose.cholesky.solve_upper(modes.vectors);
  keep(Z, modes.values, modes.vectors, out);
}

}  // namespace stiffmap
