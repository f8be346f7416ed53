// SPDX-License-Identifier: MIT
#include "stiffmap/stiffness/stiffness.hpp"

#include <cmath>

namespace stiffmap {
namespace {

constexpr double same_answer = 1e-9;    // of two ways to the compliance
constexpr double least_motion = 1e-10;  // beside the largest: below, a compliance is noise

/// Splits the unknowns into elastic coordinates theta and free ones q. Near a pole of k_theta^F all are
/// left among q: then (K1) is the whole bordered tangent.
void partition(const SaddleSystem& saddle, StiffnessWorkspace& ws) {
  ws.theta.clear();
  ws.q.clear();
  const auto& kind = saddle.kind();
  for (std::size_t j = 0; j < kind.size(); ++j)
    if (kind[j] == Kind::elastic) ws.theta.push_back(static_cast<Index>(j));
  const Index n = static_cast<Index>(ws.theta.size());
  const MatX& A = saddle.matrix();
  ws.sub.resize(n, n);
  for (Index b = 0; b < n; ++b)
    for (Index a = 0; a < n; ++a) {
      const Index i = ws.theta[at(a)], j = ws.theta[at(b)];
      ws.sub(a, b) = 0.5 * (A(i, j) + A(j, i));
    }
  const bool whole = n > 0 && (!cholesky(ws.sub) || ws.sub.diagonal().cwiseAbs2().minCoeff() < safe_pivot);
  if (whole) ws.theta.clear();
  for (std::size_t j = 0; j < kind.size(); ++j)
    if (kind[j] == Kind::free || (whole && kind[j] == Kind::elastic)) ws.q.push_back(static_cast<Index>(j));
}

bool well_conditioned(const Lu& lu) {
  const auto d = lu.pivots().cwiseAbs();
  return d.minCoeff() > pivot_alarm * std::min(1.0, d.maxCoeff());
}

/// A scaled 6x6 to SI: force rows and columns times the scales.
Mat6 unscale(const Mat6& K, const Vec6& s) { return s.asDiagonal() * K * s.asDiagonal(); }

/// Null twists of the scaled stiffness; compliance only where there are none.
void invert(const Mat6& scaled, const Vec6& s, StiffnessResult& out) {
  const Singular6 svd = singular_vectors(scaled);
  const Vec6& sv = svd.values;
  for (int i = 0; i < 6; ++i) out.free += sv[i] <= rank_threshold * std::max(sv[0], 1e-12);
  out.free_twists.setConstant(nan);
  if (out.free == 0) {
    const Vec6 si = s.cwiseInverse();
    out.compliance = unscale(inverse(scaled), si);
    return;
  }
  out.compliance.setConstant(nan);
  for (int k = 0; k < out.free; ++k) {
    const Vec6 twist = s.cwiseInverse().asDiagonal() * svd.V.col(6 - out.free + k);
    out.free_twists.col(k) = twist.normalized();
  }
}

/// The compliance has next to no motion in some direction, and the stiffness there is not its inverse: in loops that
/// are overconstrained the motion that is impossible spreads over the bordered matrix's rows, so that no residual of
/// one shows it.
bool cannot_move(const Singular6& motions, const Mat6& K) {
  const Vec6 direction = motions.V.col(5);
  const double product = motions.values[5] * direction.dot(K * direction);
  return motions.values[5] <= least_motion * motions.values[0] && !(product > 0.5);
}

}  // namespace

StiffnessWorkspace::StiffnessWorkspace(const Mechanism& m) {
  const Index n = m.size(), nl = m.closures();
  J.setZero(6 + nl, n);
  K.setZero(n, n);
  Jt.setZero(6 + nl, n);
  M.setZero(6 + nl + n, 6 + nl + n);
}

StiffnessResult point_stiffness(const Mechanism& m, const Linearization& lin, const SaddleSystem& saddle, Index node,
                                const Vec3& offset, StiffnessWorkspace& ws) {
  StiffnessResult out;
  const Index n = m.size(), nl = m.closures(), rows = 6 + nl;
  const MatX& A = saddle.matrix();
  partition(saddle, ws);
  const Index nt = static_cast<Index>(ws.theta.size()), nq = static_cast<Index>(ws.q.size());

  // Stacked Jacobian: the point, then the loops; dimensionless like the tangent.
  Vec6 s;
  s << Vec3::Constant(std::sqrt(m.stiffness)), Vec3::Constant(std::sqrt(m.stiffness) * m.length);
  lin.point_jacobian(m, node, offset, ws.J.topRows(6));
  saddle.to_unknowns(lin, ws.J.topRows(6));
  ws.J.topRows(6) = (s.asDiagonal() * ws.J.topRows(6)).eval();
  ws.J.bottomRows(nl) = -A.bottomLeftCorner(nl, n);

  // Blocks of theory (K1); the tangent holds K - H.
  ws.K.resize(nt, nt);
  ws.Jt.resize(nt, rows);
  ws.Hq.resize(nt, nq);
  for (Index b = 0; b < nt; ++b) {
    for (Index a = 0; a < nt; ++a) ws.K(a, b) = A(ws.theta[at(a)], ws.theta[at(b)]);
    ws.Jt.row(b) = ws.J.col(ws.theta[at(b)]).transpose();
  }
  for (Index b = 0; b < nq; ++b)
    for (Index a = 0; a < nt; ++a) ws.Hq(a, b) = -A(ws.theta[at(a)], ws.q[at(b)]);
  ws.X.resize(nt, rows + nq);
  if (nt > 0) {
    ws.lu_theta.compute(ws.K);  // k_theta^F = (K_theta - H_thetatheta)^-1
    ws.B.resize(nt, rows + nq);
    ws.B << ws.Jt, ws.Hq;
    ws.lu_theta.solve(ws.B, ws.X);  // k_theta^F [J_theta^T, H_thetaq]
  }
  ws.M.resize(rows + nq, rows + nq);
  ws.M.topLeftCorner(rows, rows).noalias() = ws.Jt.transpose() * ws.X.leftCols(rows);
  ws.M.topRightCorner(rows, nq).noalias() = ws.Jt.transpose() * ws.X.rightCols(nq);
  for (Index b = 0; b < nq; ++b) {
    const Index j = ws.q[at(b)];
    ws.M.col(rows + b).head(rows) += ws.J.col(j);
    for (Index a = 0; a < nt; ++a) ws.Hq(a, b) = -A(j, ws.theta[at(a)]);  // now H_qtheta, transposed
  }
  ws.M.bottomRows(nq).noalias() = ws.Hq.transpose() * ws.X;
  for (Index b = 0; b < nq; ++b) {
    ws.M.row(rows + b).head(rows) += ws.J.col(ws.q[at(b)]).transpose();
    for (Index a = 0; a < nq; ++a) ws.M(rows + a, rows + b) -= A(ws.q[at(a)], ws.q[at(b)]);
  }

  // K_F is the block of the inverse that belongs to the point: (25).
  const double soft = std::sqrt(std::max(1.0, ws.M.diagonal().head(rows).cwiseAbs().maxCoeff()));
  ws.M.topRows(rows) /= soft;
  ws.M.leftCols(rows) /= soft;
  ws.B.setZero(rows + nq, 6);
  ws.B.topRows(6).setIdentity();
  ws.lu.compute(ws.M);
  Mat6 scaled;
  if (well_conditioned(ws.lu)) {
    ws.lu.solve(ws.B, ws.X);
    scaled = ws.X.topRows<6>() / (soft * soft);
  } else {
    Orthogonal cod(ws.M.rows(), ws.M.cols());
    cod.compute(ws.M, rank_threshold);
    cod.solve(ws.B, ws.X);
    scaled = ws.X.topRows<6>() / (soft * soft);
    // Nothing solves for a motion that is impossible; a truncated near-null direction leaves far less.
    if ((ws.M * ws.X - ws.B).cwiseAbs().maxCoeff() > 0.3) out.flags |= flag::rigid_direction;
  }
  if (out.flags & flag::rigid_direction) {  // some motion of the point is impossible: see compliance
    out.stiffness.setConstant(nan);
    out.compliance.setConstant(nan);
    out.free_twists.setConstant(nan);
    return out;
  }
  out.stiffness = unscale(scaled, s);
  invert(scaled, s, out);
  return out;
}

void by_compliance(const Mechanism& m, const Mat6& C, bool regular, StiffnessResult& out) {
  const bool rigid = out.flags & flag::rigid_direction;
  if (rigid) out.compliance = C;
  Vec6 s;
  s << Vec3::Constant(std::sqrt(m.stiffness)), Vec3::Constant(std::sqrt(m.stiffness) * m.length);
  const Mat6 scaled = unscale(C, s);
  if (!regular || !scaled.allFinite()) return;
  const Singular6 motions = singular_vectors(scaled);
  const Vec6& sizes = motions.values;
  if (!rigid && cannot_move(motions, unscale(out.stiffness, s.cwiseInverse()))) {
    out.flags |= flag::rigid_direction;
    out.stiffness.setConstant(nan);
  }
  // A soft direction beside very stiff ones: the tangent, with units of its own, tells it from none.
  if (out.free > 0 || (!rigid && out.flags & flag::rigid_direction)) {
    out.free = 0;
    out.free_twists.setConstant(nan);
    out.compliance = C;
    return;
  }
  if (!(sizes[5] > least_motion * sizes[0])) return;
  const Vec6 d = scaled.diagonal().cwiseAbs().cwiseSqrt().cwiseInverse();
  const Mat6 gap = unscale(unscale(out.compliance, s) - scaled, d);
  if (!rigid && gap.cwiseAbs().maxCoeff() < same_answer) return;
  out.compliance = C;
  out.stiffness = unscale(inverse(scaled), s);
  out.flags &= ~flag::rigid_direction;
}

}  // namespace stiffmap
