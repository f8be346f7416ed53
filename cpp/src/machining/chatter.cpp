// SPDX-License-Identifier: MIT
#include "stiffmap/machining/chatter.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/common/parallel.hpp"

namespace stiffmap {
namespace {

constexpr int most_terms = 18;  // of an exponential whose argument is at most one
constexpr Index first_look = 10, most_together = 8, most_nodes = 12;
constexpr double settled = 1e-10;  // residual of the largest multiplier, relative
constexpr double exact = 1e-13;    // of blocks by interpolation, whose entries are of order one

/// Scratch of one row of depths.
struct ChatterWorkspace {
  MatX step, term, next;   // of one interval
  MatX blocks;             // maps of some intervals each, one a column
  MatX basis, hessenberg;  // of the search, which begins near what the last one found
  VecX start, past, from, to;
  Eigen::VectorXcd found;
  Index look = first_look;  // size at which the search first asks whether it has settled: that of the last one
};

/// Exact step of an interval: rows q and q' by the highest frequency, columns the same and what the last pass left.
void transition(const ToolModes& m, const Chip& gain, double length, ChatterWorkspace& ws) {
  const Index n = m.omega.size();
  const double own = m.omega.maxCoeff();
  const MatX pushed = m.mass.cwiseInverse().asDiagonal() * (m.way.transpose() * gain) / own;
  MatX turned = pushed * m.way.topRows<2>();
  turned.diagonal() -= m.omega.cwiseAbs2() / own;
  const VecX slowed = -2 * m.ratio.cwiseProduct(m.omega);
  const double fastest = std::max(own, turned.norm()) + slowed.cwiseAbs().maxCoeff();
  const double pieces = std::ceil(std::max(1.0, length * fastest)), h = length / pieces;
  ws.step.setIdentity(2 * n, 2 * n + 2);
  ws.next.resize(2 * n, 2 * n + 2);
  for (int piece = 0; piece < pieces; ++piece) {
    ws.term = ws.step;
    double left = 1;
    for (int j = 1; j <= most_terms && left > 1e-17; ++j) {
      ws.next.topRows(n) = own * ws.term.bottomRows(n);
      ws.next.bottomRows(n) = turned.lazyProduct(ws.term.topRows(n)) + slowed.asDiagonal() * ws.term.bottomRows(n);
      if (j == 1) ws.next.bottomRightCorner(n, 2) -= pushed;
      ws.term = (h / j) * ws.next;
      ws.step += ws.term;
      left *= h * fastest / j;
    }
  }
}

/// Some intervals at once: from the state and displacements of the last pass to the state and those of this pass.
void prepare(const ToolModes& m, const std::vector<Chip>& chips, double period, double depth, ChatterWorkspace& ws) {
  const auto k = static_cast<Index>(chips.size());
  const Index n = m.omega.size(), together = k > most_together ? std::gcd(k, most_together) : 1;
  const Index rows = 2 * n + 2 * together, columns = rows + 2;
  const MatX before = MatX::Identity(columns, columns).bottomRows(2 * together + 2);
  ws.blocks.setZero(rows * columns, k / together);
  for (Index i = 0; i < k; ++i) {
    const Index j = 2 * (i % together);
    Eigen::Map<MatX> block(ws.blocks.col(i / together).data(), rows, columns);
    if (j == 0) block.topRows(2 * n).setIdentity();
    const Chip cut = depth * chips[static_cast<std::size_t>(i)];
    const Chip gain = (Mat3::Identity() - cut * m.rest.topRows<2>()).inverse() * cut;
    transition(m, gain, period / static_cast<double>(k), ws);
    const MatX bent = m.way.topRows<2>() * block.topRows(n);
    block.middleRows(2 * n + j, 2) = bent + m.rest.topRows<2>() * gain * (bent - before.middleRows(j, 2));
    const MatX mean = 0.5 * (before.middleRows(j, 2) + before.middleRows(j + 2, 2));
    const MatX moved = ws.step.leftCols(2 * n) * block.topRows(2 * n) + ws.step.rightCols(2) * mean;
    block.topRows(2 * n) = moved;
  }
}

/// One tooth period: state, then displacements of the last period, the oldest first.
void pass(Index state, ChatterWorkspace& ws, VecX& z) {
  const Index past = z.size() - state, many = past / ws.blocks.cols(), rows = state + many;
  ws.past.resize(past + 2);
  ws.past.head(past) = z.tail(past);
  ws.from.resize(rows + 2);
  for (Index i = 0; i < ws.blocks.cols(); ++i) {
    ws.from << z.head(state), ws.past.segment(i * many, many + 2);
    ws.to.noalias() = Eigen::Map<const MatX>(ws.blocks.col(i).data(), rows, rows + 2) * ws.from;
    z.head(state) = ws.to.head(state);
    z.segment(state + i * many, many) = ws.to.tail(many);
    if (i == 0) ws.past.tail<2>() = ws.to.segment<2>(state);  // where the last pass ended
  }
}

/// Arnoldi's iteration on the map of one tooth period, from what the last calls found.
double dominant(Index state, Index size, ChatterWorkspace& ws) {
  if (!(ws.start.norm() > 0) || !ws.start.allFinite())
    ws.start = 1 + 0.5 * (1.7 * Eigen::ArrayXd::LinSpaced(size, 0, static_cast<double>(size - 1)).square() + 0.3).sin();
  const Index most = std::min<Index>(size, 120);
  ws.basis.resize(size, most + 1);
  ws.hessenberg.resize(most + 1, most);
  ws.basis.col(0) = ws.start.normalized();
  for (Index j = 0;; ++j) {
    VecX z = ws.basis.col(j);
    pass(state, ws, z);
    const double before = z.norm();
    ws.hessenberg.col(j).setZero();
    for (int twice = 0; twice < 2; ++twice) {
      const VecX c = ws.basis.leftCols(j + 1).transpose() * z;
      z -= ws.basis.leftCols(j + 1) * c;
      ws.hessenberg.col(j).head(j + 1) += c;
    }
    const double rest = z.norm();
    ws.hessenberg(j + 1, j) = rest;
    const bool last = j + 1 == most || rest <= 1e-14 * before;
    if (last || j + 1 >= ws.look) {
      const ComplexEigen e = general_eigen(MatX(ws.hessenberg.topLeftCorner(j + 1, j + 1)));
      Index best = 0;
      const double top = e.values.cwiseAbs().maxCoeff(&best);
      const double unsettled = rest * std::abs(e.vectors(j, best)) / (settled * std::max(top, 1e-3));
      if (last || unsettled <= 1) {
        ws.look = unsettled > 0.1 ? j + 1 : std::max<Index>(j, 2);
        Eigen::VectorXcd found = ws.basis.leftCols(j + 1) * e.vectors.col(best);
        const std::complex<double> turn = ws.found.size() > 0 ? ws.found.dot(found) : 0;
        const bool same = std::abs(turn) > 0.9;  // of length one both: the path of one vector goes on
        if (same) found *= std::conj(turn) / std::abs(turn);
        ws.start = same ? VecX((2 * found - ws.found).real()) : VecX(found.real());
        ws.start += 1e-3 * ws.basis.col(0);
        ws.found = found;
        return top;
      }
    }
    ws.basis.col(j + 1) = z / rest;
  }
}

/// Lagrange's weights of nodes at a depth.
VecX weights(const VecX& nodes, double depth) {
  VecX w = VecX::Ones(nodes.size());
  for (Index i = 0; i < nodes.size(); ++i)
    for (Index j = 0; j < nodes.size(); ++j)
      if (i != j) w[i] *= (depth - nodes[j]) / (nodes[i] - nodes[j]);
  return w;
}

}  // namespace

VecX largest_multipliers(const ToolModes& modes, const std::vector<Chip>& chips, double period, const VecX& depths) {
  ChatterWorkspace ws;
  const Index state = 2 * modes.omega.size(), size = state + 2 * static_cast<Index>(chips.size());
  VecX nodes, out(depths.size());
  MatX at_nodes, at_ends;  // blocks, one depth a column
  const auto keep = [&](MatX& kept, const VecX& at) {
    for (Index i = 0; i < at.size(); ++i) {
      prepare(modes, chips, period, at[i], ws);
      kept.resize(ws.blocks.size(), at.size());
      kept.col(i) = ws.blocks.reshaped();
    }
  };
  bool direct = true;  // or else polynomials in the depth through Chebyshev's nodes, judged where they are worst
  for (Index count = 4; direct && count <= most_nodes && count + 2 < depths.size(); count += 2) {
    const double low = depths.minCoeff(), high = depths.maxCoeff(), gap = std::numbers::pi / static_cast<double>(count);
    nodes = VecX::LinSpaced(count, 0.5 * gap, std::numbers::pi - 0.5 * gap).array().cos();
    nodes = (0.5 * (low + high) + 0.5 * (high - low) * nodes.array()).matrix();
    keep(at_nodes, nodes);
    if (at_ends.size() == 0) keep(at_ends, Eigen::Vector2d(low, high));
    direct = !((at_nodes * weights(nodes, low) - at_ends.col(0)).cwiseAbs().maxCoeff() <= exact &&
               (at_nodes * weights(nodes, high) - at_ends.col(1)).cwiseAbs().maxCoeff() <= exact);
  }
  for (Index j = 0; j < depths.size(); ++j) {
    if (direct) prepare(modes, chips, period, depths[j], ws);
    else ws.blocks.reshaped().noalias() = at_nodes * weights(nodes, depths[j]);
    out[j] = dominant(state, size, ws);
  }
  return out;
}

Answers largest_multipliers(const ToolModes& modes, const std::vector<Chip>& chips, const VecX& periods,
                            const VecX& depths, int threads) {
  for (const Index given : {modes.ratio.size(), modes.mass.size(), modes.way.cols()})
    require(given == modes.omega.size(), "modes", "as many of each number", given);
  Answers out(periods.size());
  const Blocks found = out.numbers("multipliers", {depths.size()});
  parallel_chunks(periods.size(), 1, threads, [&](int, long begin, long end) {
    for (long i = begin; i < end; ++i) found(i) = largest_multipliers(modes, chips, periods[i], depths);
  });
  return out;
}

}  // namespace stiffmap
