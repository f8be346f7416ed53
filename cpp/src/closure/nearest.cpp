// SPDX-License-Identifier: MIT
// Of all configurations that a commanded pose leaves to a redundant machine: the nearest one (theory C11).
#include <algorithm>
#include <cmath>

#include "closing.hpp"

namespace stiffmap::closing {
namespace {

constexpr double stride = 1e-6;  // of the length: differences of the slopes

/// d log(R) = T w for a turn w of R, log R = phi.
Mat3 turn_of_logarithm(const Vec3& phi) {
  const double t = phi.norm();
  const Mat3 S = skew(phi);
  const double c = t < 1e-3 ? 1.0 / 12 + t * t / 720 : 1 / (t * t) - (1 + std::cos(t)) / (2 * t * std::sin(t));
  return Mat3::Identity() - 0.5 * S + c * S * S;
}

/// Slopes at x exactly as the residual has them: where the task leaves rotations open, its error is a large angle.
void slopes(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws) {
  forward(m, Geometry::nominal, x, ws.frames, &ws.charts);
  equations(m, target, ws);
  if (target.task == full_task) return;
  const Mat3 &R = ws.frames.at(m.tip).R, &goal = target.tip->R;
  const Mat3 T = goal.transpose() * turn_of_logarithm(log_so3(R * goal.transpose()));
  for (std::size_t k = 0; k < ws.unknown.size(); ++k) {
    const Index j = ws.unknown[k];
    Vec3 turned = Vec3::Zero();
    const auto& path = m.path[at(m.tip)];
    if (std::find(path.begin(), path.end(), j) != path.end())
      turned = T * column(m, ws.frames, j, ws.frames.at(m.tip).p).tail<3>();
    for (int i = 0; i < 3; ++i)
      ws.A(3 + i, static_cast<Index>(k)) = target.task[at(3 + i)] ? turned[i] * m.length / m.unit(j) : 0.0;
  }
}

/// Second derivatives of what the multipliers weigh, and the weights of the distance.
void curvature(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws) {
  const Index n = static_cast<Index>(ws.unknown.size());
  ws.H.resize(n, n);
  slopes(m, x, target, ws);
  const VecX now = ws.A.transpose() * ws.multipliers;
  VecX moved = x;
  for (Index k = 0; k < n; ++k) {
    const Index j = ws.unknown[at(k)];
    moved[j] = x[j] + stride * m.length / m.unit(j);
    slopes(m, moved, target, ws);
    ws.H.col(k) = (ws.A.transpose() * ws.multipliers - now) / (stride * m.length);
    moved[j] = x[j];
  }
  for (Index k = 0; k < n; ++k) ws.H(k, k) += m.nearness[ws.unknown[at(k)]];
  slopes(m, x, target, ws);
}

/// Slope of half the squared distance.
VecX away(const Mechanism& m, const VecX& x, const ClosureWorkspace& ws) {
  VecX out(static_cast<Index>(ws.unknown.size()));
  for (std::size_t k = 0; k < ws.unknown.size(); ++k) {
    const Index j = ws.unknown[k];
    out[static_cast<Index>(k)] = m.nearness[j] * m.unit(j) * (x[j] - ws.wanted[j]);
  }
  return out;
}

}  // namespace

void estimate_multipliers(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws) {
  slopes(m, x, target, ws);
  ws.qr.compute(ws.A.transpose(), rank_threshold);
  ws.qr.solve(-away(m, x, ws), ws.multipliers);
}

double nearest_step(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws) {
  const Index n = static_cast<Index>(ws.unknown.size()), rows = ws.e.size();
  curvature(m, x, target, ws);
  ws.bordered.setZero(n + rows, n + rows);
  ws.bordered.topLeftCorner(n, n) = ws.H;
  ws.bordered.topRightCorner(n, rows) = ws.A.transpose();
  ws.bordered.bottomLeftCorner(rows, n) = ws.A;
  ws.right.resize(n + rows);
  ws.right << -away(m, x, ws), -ws.e;
  ws.qr.compute(ws.bordered, rank_threshold);
  ws.qr.solve(ws.right, ws.shortest);
  ws.multipliers = ws.shortest.tail(rows);
  ws.step.head(n) = ws.shortest.head(n);
  const double norm = ws.step.head(n).norm() / m.length;
  for (Index k = 0; k < n; ++k) ws.step[k] /= m.unit(ws.unknown[at(k)]);
  return norm;
}

bool is_nearest(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws) {
  estimate_multipliers(m, x, target, ws);
  curvature(m, x, target, ws);
  ws.qr.compute(ws.A, rank_threshold);
  const MatX Z = ws.qr.null_vectors();
  const MatX open = Z.transpose() * ws.H * Z;
  return Z.cols() > 0 && symmetric_eigen(MatX(0.5 * (open + open.transpose()))).values[0] > 0;
}

}  // namespace stiffmap::closing
