// SPDX-License-Identifier: MIT
#include "stiffmap/chatter.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "stiffmap/dense.hpp"

namespace stiffmap {
namespace {

using Vec2 = Eigen::Vector2d;
constexpr int taylor_terms = 16;        // of an exponential whose argument is below one
constexpr double settled = 1e-10;       // residual of the largest multiplier, relative
constexpr Index first_look = 8, looks = 4;

/// d/dt of (q, q') in columns, the first two rows of `passed` being what the last pass left.
struct Rate {
  const ToolModes& modes;
  const Chip& gain;
  void operator()(const MatX& v, const MatX& passed, MatX& out) const {
    const Index n = modes.omega.size();
    const MatX seen = modes.way.topRows<2>() * v.topRows(n) - passed;
    const MatX force = modes.way.transpose() * (gain * seen);
    out.resize(v.rows(), v.cols());
    out.topRows(n) = v.bottomRows(n);
    for (Index k = 0; k < n; ++k) {
      const double w = modes.omega[k];
      out.row(n + k) = -w * w * v.row(k) - 2 * modes.ratio[k] * w * v.row(n + k) + force.row(k) / modes.mass[k];
    }
  }
};

/// Exact step of one interval with constant coefficients: columns for the state, then for the last pass.
void transition(const Rate& rate, double length, double fastest, MatX& step, MatX& push) {
  const Index n = 2 * rate.modes.omega.size();
  const int pieces = static_cast<int>(std::ceil(std::max(1.0, length * fastest)));
  const double h = length / pieces;
  MatX state = MatX::Zero(n, n + 2), passed = MatX::Zero(2, n + 2), term, next;
  state.leftCols(n).setIdentity();
  passed.rightCols<2>().setIdentity();
  const MatX none = MatX::Zero(2, n + 2);
  for (int piece = 0; piece < pieces; ++piece) {
    rate(state, passed, term);
    double factor = h;
    for (int j = 2; j <= taylor_terms; ++j) {
      state += factor * term;
      rate(term, none, next);
      term.swap(next);
      factor *= h / j;
    }
    state += factor * term;
  }
  step = state.leftCols(n);
  push = state.rightCols<2>();
}

/// One tooth period: state, then displacements of the last period, the oldest first.
void pass(const ToolModes& modes, ChatterWorkspace& ws, Eigen::Ref<VecX> z) {
  const Index n = modes.omega.size(), k = static_cast<Index>(ws.step.size());
  VecX y = z.head(2 * n);
  auto& w = ws.passed;
  w.resize(static_cast<std::size_t>(2 * k));
  for (Index i = 0; i < k; ++i) w[static_cast<std::size_t>(i)] = z.segment<2>(2 * n + 2 * i);
  for (Index i = 0; i < k; ++i) {
    const auto at = static_cast<std::size_t>(i), now = static_cast<std::size_t>(k + i);
    const Vec2 bent = modes.way.topRows<2>() * y.head(n);
    w[now] = bent + modes.rest.topRows<2>() * (ws.gain[at] * (bent - w[at]));
    const Vec2 mean = 0.5 * (w[at] + w[at + 1]);
    y = (ws.step[at] * y + ws.push[at] * mean).eval();
  }
  z.head(2 * n) = y;
  for (Index i = 0; i < k; ++i) z.segment<2>(2 * n + 2 * i) = w[static_cast<std::size_t>(k + i)];
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
  const Index size = 2 * modes.omega.size() + 2 * static_cast<Index>(ws.step.size());
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
    pass(modes, ws, z);
    const double before = z.norm();
    for (int twice = 0; twice < 2; ++twice) {
      const VecX c = ws.basis.leftCols(j + 1).transpose() * z;
      z -= ws.basis.leftCols(j + 1) * c;
      ws.hessenberg.col(j).head(j + 1) += c;
    }
    const double rest = z.norm();
    ws.hessenberg(j + 1, j) = rest;
    const bool last = j + 1 == most || rest <= 1e-14 * before;
    if (last || (j + 1 >= first_look && (j + 1) % looks == 0)) {
      top = ritz(ws.hessenberg, j + 1, residual, vector);
      if (last || residual <= settled * std::max(top, 1e-3)) {
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
  const std::size_t k = chips.size();
  ws.step.resize(k);
  ws.push.resize(k);
  ws.gain.resize(k);
  const double square = modes.omega.cwiseAbs2().maxCoeff(), softest = modes.mass.minCoeff();
  for (std::size_t i = 0; i < k; ++i) {
    const Chip cut = depth * chips[i];
    ws.gain[i] = (Mat3::Identity() - cut * modes.rest.topRows<2>()).inverse() * cut;
    const double fastest =
        std::sqrt(square + static_cast<double>(modes.omega.size()) * ws.gain[i].norm() / softest) + modes.ratio.maxCoeff() * std::sqrt(square);
    transition({modes, ws.gain[i]}, period / static_cast<double>(k), fastest, ws.step[i], ws.push[i]);
  }
  return dominant(modes, ws);
}

}  // namespace stiffmap
