// SPDX-License-Identifier: MIT
#include "stiffmap/chatter.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "stiffmap/dense.hpp"

namespace stiffmap {
namespace {

using Vec2 = Eigen::Vector2d;
constexpr int most_terms = 18;  // of an exponential whose argument is at most one
constexpr Index first_look = 10, looks = 6;

/// d/dt of (q, q') by rows of `columns` numbers; the last two columns are pushed by what the last pass left.
void rate(const ToolModes& m, const Chip& gain, std::size_t columns, bool pushed, const double* v, double* out) {
  const auto n = static_cast<std::size_t>(m.omega.size());
  std::copy(v + n * columns, v + 2 * n * columns, out);
  for (std::size_t c = 0; c < columns; ++c) {
    Vec2 seen = Vec2::Zero();
    for (std::size_t k = 0; k < n; ++k) {
      const auto i = static_cast<Index>(k);
      seen[0] += m.way(0, i) * v[k * columns + c];
      seen[1] += m.way(1, i) * v[k * columns + c];
    }
    if (pushed && c + 2 == columns) seen[0] -= 1;
    if (pushed && c + 1 == columns) seen[1] -= 1;
    const Vec3 force = gain * seen;
    for (std::size_t k = 0; k < n; ++k) {
      const auto i = static_cast<Index>(k);
      const double w = m.omega[i];
      out[(n + k) * columns + c] = -w * w * v[k * columns + c] - 2 * m.ratio[i] * w * v[(n + k) * columns + c] +
                                   m.way.col(i).dot(force) / m.mass[i];
    }
  }
}

/// Exact step of one interval with constant coefficients, into 2 n rows of 2 n + 2 numbers.
void transition(const ToolModes& m, const Chip& gain, double length, double fastest, ChatterWorkspace& ws,
                double* step) {
  const auto n = 2 * static_cast<std::size_t>(m.omega.size());
  const std::size_t columns = n + 2, size = n * columns;
  const int pieces = static_cast<int>(std::ceil(std::max(1.0, length * fastest)));
  const double h = length / pieces, argument = h * fastest;
  ws.state.assign(size, 0.0);
  ws.term.resize(size);
  ws.next.resize(size);
  for (std::size_t i = 0; i < n; ++i) ws.state[i * columns + i] = 1;
  for (int piece = 0; piece < pieces; ++piece) {
    rate(m, gain, columns, true, ws.state.data(), ws.term.data());
    double factor = h, left = argument;
    for (int j = 2; j <= most_terms; ++j) {
      for (std::size_t i = 0; i < size; ++i) ws.state[i] += factor * ws.term[i];
      left *= argument / j;
      if (left < 1e-17) break;
      rate(m, gain, columns, false, ws.term.data(), ws.next.data());
      ws.term.swap(ws.next);
      factor *= h / j;
    }
  }
  std::copy(ws.state.begin(), ws.state.end(), step);
}

/// One tooth period: state, then displacements of the last period, the oldest first.
void pass(const ToolModes& m, ChatterWorkspace& ws, double* z) {
  const auto n = static_cast<std::size_t>(m.omega.size());
  const std::size_t k = ws.gain.size(), rows = 2 * n, columns = rows + 2;
  const bool rests = !m.rest.isZero(0);
  ws.passed.resize(4 * k);
  ws.next.resize(rows);
  std::copy(z + rows, z + rows + 2 * k, ws.passed.begin());
  for (std::size_t i = 0; i < k; ++i) {
    Vec2 bent = Vec2::Zero();
    for (std::size_t j = 0; j < n; ++j) bent += z[j] * m.way.col(static_cast<Index>(j)).head<2>();
    double* w = ws.passed.data() + 2 * i;
    if (rests) bent += m.rest.topRows<2>() * (ws.gain[i] * (bent - Vec2(w[0], w[1])));
    w[2 * k] = bent[0];
    w[2 * k + 1] = bent[1];
    const double x = 0.5 * (w[0] + w[2]), y = 0.5 * (w[1] + w[3]);
    const double* row = ws.step.data() + i * rows * columns;
    for (std::size_t r = 0; r < rows; ++r, row += columns) {
      double sum = row[rows] * x + row[rows + 1] * y;
      for (std::size_t c = 0; c < rows; ++c) sum += row[c] * z[c];
      ws.next[r] = sum;
    }
    std::copy(ws.next.begin(), ws.next.begin() + static_cast<std::ptrdiff_t>(rows), z);
  }
  std::copy(ws.passed.begin() + static_cast<std::ptrdiff_t>(2 * k), ws.passed.end(), z + rows);
}

/// Largest eigenvalue of the leading j x j block and the length of its residual; `vector`: its real direction.
double ritz(const MatX& H, Index j, double& residual, VecX& vector) {
  const ComplexEigen e = general_eigen(MatX(H.topLeftCorner(j, j)));
  Index best = 0;
  const double top = e.values.cwiseAbs().maxCoeff(&best);
  residual = std::abs(H(j, j - 1)) * std::abs(e.vectors(j - 1, best));
  vector = e.vectors.col(best).real();
  return top;
}

/// Arnoldi's iteration on the map of one tooth period, from what the last call found.
double dominant(const ToolModes& modes, ChatterWorkspace& ws) {
  const Index size = 2 * modes.omega.size() + 2 * static_cast<Index>(ws.gain.size());
  if (ws.start.size() != size || !(ws.start.norm() > 0) || !ws.start.allFinite()) {
    ws.start.resize(size);
    for (Index i = 0; i < size; ++i) ws.start[i] = 1 + 0.5 * std::sin(1.7 * static_cast<double>(i * i) + 0.3);
  }
  const Index most = std::min<Index>(size, 120);
  ws.basis.resize(size, most + 1);
  ws.hessenberg.setZero(most + 1, most);
  ws.basis.col(0) = ws.start.normalized();
  double top = 0, residual = 0;
  VecX vector;
  for (Index j = 0; j < most; ++j) {
    VecX z = ws.basis.col(j);
    pass(modes, ws, z.data());
    const double before = z.norm();
    for (int twice = 0; twice < 2; ++twice) {
      const VecX c = ws.basis.leftCols(j + 1).transpose() * z;
      z -= ws.basis.leftCols(j + 1) * c;
      ws.hessenberg.col(j).head(j + 1) += c;
    }
    const double rest = z.norm();
    ws.hessenberg(j + 1, j) = rest;
    const bool last = j + 1 == most || rest <= 1e-14 * before;
    if (last || (j + 1 >= first_look && (j + 1 - first_look) % looks == 0)) {
      top = ritz(ws.hessenberg, j + 1, residual, vector);
      if (last || residual <= ws.settled * std::max(top, 1e-3)) {
        ws.start = ws.basis.leftCols(j + 1) * vector + 1e-3 * ws.basis.col(0);
        return top;
      }
    }
    ws.basis.col(j + 1) = z / rest;
  }
  return top;
}

}  // namespace

double largest_multiplier(const ToolModes& modes, const std::vector<Chip>& chips, double period, double depth,
                          ChatterWorkspace& ws) {
  const std::size_t k = chips.size(), rows = 2 * static_cast<std::size_t>(modes.omega.size()), size = rows * (rows + 2);
  ws.step.resize(k * size);
  ws.gain.resize(k);
  const double own = modes.omega.maxCoeff(), lightest = modes.mass.minCoeff();
  for (std::size_t i = 0; i < k; ++i) {
    const Chip cut = depth * chips[i];
    ws.gain[i] = modes.rest.isZero(0) ? cut : Chip((Mat3::Identity() - cut * modes.rest.topRows<2>()).inverse() * cut);
    const double fastest =
        std::sqrt(own * own + static_cast<double>(modes.omega.size()) * ws.gain[i].norm() / lightest) +
        2 * modes.ratio.maxCoeff() * own;
    transition(modes, ws.gain[i], period / static_cast<double>(k), fastest, ws, ws.step.data() + i * size);
  }
  return dominant(modes, ws);
}

}  // namespace stiffmap
