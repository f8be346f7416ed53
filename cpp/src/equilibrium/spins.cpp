// SPDX-License-Identifier: MIT
#include "stiffmap/equilibrium/spins.hpp"

#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double no_moment = 1e-11;  // of a moment, against all loads at the machine's length
constexpr double centred = 1e-9;     // of the length: a spin that moves a body's centre less leaves it
constexpr double longest_turn = 0.4;
constexpr double small_turn = 1e-12;
constexpr int most_turns = 100;
constexpr int most_polishing = 2;  // steps below the noise that is told from a moment

}  // namespace

Spins::Spins(const Mechanism& m) : m_(m), force_(VecX::Zero(m.size())), closure_(VecX::Zero(m.closures())) {
  for (Index j = 0; j < m.size(); ++j)
    if (m.coordinates[at(j)].locked && m.coordinates[at(j)].role == Role::passive) held_.push_back(j);
  if (held_.empty() || m.bodies.empty()) return;
  EquilibriumWorkspace eq(m);
  Problem p(m);
  p.base = m.home_coordinates;
  p.secant_laws = true;
  p.unpulled = true;  // a spin leaves the tip where it is, but without equilibrium such a force would move the rest
  factorize_at(m, p, State(m), eq);
  move_each(eq);
  MatX J(6, m.size());
  moves_a_body_.assign(held_.size(), false);
  for (const NodeBody& b : m.bodies) {
    if (b.mass == 0) continue;
    eq.lin.point_jacobian(m, b.node, b.com, J);
    const MatX moved = J.topRows(3) * motion_;
    for (std::size_t k = 0; k < held_.size(); ++k)
      if (moved.col(static_cast<Index>(k)).cwiseAbs().maxCoeff() > centred * m.length)
        off_axis_ = moves_a_body_[k] = true;
  }
}

bool Spins::loaded(const Problem& p) const {
  if (held_.empty()) return false;
  if (off_axis_ && !p.gravity.isZero(0)) return true;
  return std::any_of(p.load_points.begin(), p.load_points.end(), [&](const LoadPoint& l) { return l.node != m_.tip; });
}

bool Spins::decided(Index coordinate) const {
  return std::find(turning_.begin(), turning_.end(), coordinate) != turning_.end();
}

double Spins::noise(const Problem& p) const {
  double sum = 0;
  for (const NodeBody& b : m_.bodies) sum += b.mass * p.gravity.norm() * m_.length;
  for (const Vec6& w : p.wrenches) sum += w.head<3>().norm() * m_.length + w.tail<3>().norm();
  return no_moment * sum;
}

/// How everything else moves with a unit of each held spin, the loads as they are.
void Spins::move_each(EquilibriumWorkspace& eq) {
  const Index n = static_cast<Index>(held_.size());
  motion_.resize(m_.size(), n);
  wrench_.resize(m_.closures(), n);
  for (Index k = 0; k < n; ++k) {
    const Index j = held_[at(k)];
    for (Index i = 0; i < m_.size(); ++i)
      force_[i] = eq.lin.kind[at(i)] == Kind::fixed ? 0.0 : -eq.lin.da[i] * (eq.lin.K(i, j) - eq.lin.H(i, j));
    closure_ = eq.lin.J.col(j);
    eq.saddle.solve(force_, closure_, eq.dz, eq.dlambda);
    motion_.col(k) = eq.dz.cwiseProduct(eq.lin.da);
    motion_(j, k) = 1;
    wrench_.col(k) = eq.dlambda;
  }
}

/// Holding moments and their derivatives; which spins a load turns.
void Spins::measure(const Problem& p, EquilibriumWorkspace& eq) {
  move_each(eq);
  const Index n = static_cast<Index>(held_.size());
  MatX all(n, n);
  for (Index k = 0; k < n; ++k) {
    const Index j = held_[at(k)];
    all.row(k) = (eq.lin.K.row(j) - eq.lin.H.row(j)) * motion_ - eq.lin.J.col(j).transpose() * wrench_;
  }
  // Residuals of round-off in stiff springs would turn the spins: what the next step takes away is not counted.
  force_balance(m_, eq.lin, eq.saddle, force_);
  eq.saddle.solve(force_, eq.lin.e, eq.dz, eq.dlambda);
  eq.dz = eq.dz.cwiseProduct(eq.lin.da).eval();
  VecX moment(n);
  for (Index k = 0; k < n; ++k) {
    const Index j = held_[at(k)];
    moment[k] = eq.lin.r[j] + (eq.lin.K.row(j) - eq.lin.H.row(j)).dot(eq.dz) - eq.lin.J.col(j).dot(eq.dlambda);
  }
  const double least = noise(p);
  turning_.clear();
  std::vector<Index> which;
  for (Index k = 0; k < n; ++k)
    if (std::abs(moment[k]) > least || all.row(k).cwiseAbs().maxCoeff() > 1e3 * least) {
      turning_.push_back(held_[at(k)]);
      which.push_back(k);
    }
  const Index t = static_cast<Index>(which.size());
  curve_.resize(t, t);
  moment_.resize(t);
  for (Index a = 0; a < t; ++a) {
    moment_[a] = moment[which[at(a)]];
    for (Index b = 0; b < t; ++b) curve_(a, b) = all(which[at(a)], which[at(b)]);
  }
  MatX kept(m_.size(), t), kept_wrench(m_.closures(), t);
  for (Index a = 0; a < t; ++a) {
    kept.col(a) = motion_.col(which[at(a)]);
    kept_wrench.col(a) = wrench_.col(which[at(a)]);
  }
  motion_ = kept;
  wrench_ = kept_wrench;
}

bool Spins::settle(Problem& p, const EquilibriumOptions& options, EquilibriumWorkspace& eq, State& state,
                   EquilibriumResult& out) {
  EquilibriumOptions near = options;
  near.load_steps = 1;
  int polished = 0;
  for (int k = 0; k < most_turns; ++k) {
    measure(p, eq);
    const Index n = static_cast<Index>(turning_.size());
    if (n == 0) return true;
    const EigenX eigen = symmetric_eigen(MatX(0.5 * (curve_ + curve_.transpose())));
    const double least = noise(p);
    // Downhill along every eigenvector; from the top of the hill to either side.
    VecX turn = VecX::Zero(n);
    bool downhill = true, at_rest = true;
    for (Index i = 0; i < n; ++i) {
      const double slope = eigen.vectors.col(i).dot(moment_), curve = eigen.values[i];
      if (std::abs(slope) <= least && curve < -1e3 * least) turn += longest_turn * eigen.vectors.col(i);
      else turn -= slope / std::max(std::abs(curve), least) * eigen.vectors.col(i);
      downhill = downhill && curve > 0;
      at_rest = at_rest && std::abs(slope) <= least;
    }
    const double size = turn.cwiseAbs().maxCoeff();
    if (downhill && (size < small_turn || (at_rest && ++polished > most_polishing))) return true;
    if (size > longest_turn) turn *= longest_turn / size;
    for (Index i = 0; i < n; ++i) p.base[turning_[at(i)]] += turn[i];
    for (Index j = 0; j < m_.size(); ++j)
      if (eq.lin.kind[at(j)] != Kind::fixed && eq.lin.da[j] > 0) state.z[j] += motion_.row(j).dot(turn) / eq.lin.da[j];
    state.lambda += wrench_ * turn;
    const EquilibriumResult next = solve_equilibrium(m_, p, near, eq, state);
    out.iterations += next.iterations;
    if (next.status != Status::converged) return false;
    out.falling = next.falling;
    if (size < small_turn) return downhill;
  }
  return false;
}

void Spins::release(const NodePoint& point, EquilibriumWorkspace& eq, StiffnessResult& k) {
  const Index n = static_cast<Index>(turning_.size());
  if (n == 0 || !(k.stiffness.allFinite() || k.compliance.allFinite())) return;
  MatX J(6, m_.size());
  eq.lin.point_jacobian(m_, point.node, point.offset, J);
  const MatX V = J * motion_;  // twist of the point by a unit of each spin
  MatX U(n, 6);                // moment on each spin by a unit wrench at the point
  for (int c = 0; c < 6; ++c) {
    force_ = J.row(c).transpose();
    for (Index i = 0; i < m_.size(); ++i) force_[i] *= eq.lin.kind[at(i)] == Kind::fixed ? 0.0 : eq.lin.da[i];
    eq.saddle.solve(force_, VecX::Zero(m_.closures()), eq.dz, eq.dlambda);
    eq.dz = eq.dz.cwiseProduct(eq.lin.da).eval();
    for (Index a = 0; a < n; ++a) {
      const Index j = turning_[at(a)];
      U(a, c) = J(c, j) - (eq.lin.K.row(j) - eq.lin.H.row(j)).dot(eq.dz) + eq.lin.J.col(j).dot(eq.dlambda);
    }
  }
  if (!k.stiffness.allFinite()) {  // a rigid direction
    MatX turned;
    Lu lu(n);
    lu.compute(curve_);
    lu.solve(U, turned);
    k.compliance += V * turned;
    return;
  }
  // (C + V S^-1 U)^-1
  const MatX left = curve_ + U * k.stiffness * V, right = U * k.stiffness;
  MatX X;
  Lu lu(n);
  lu.compute(left);
  lu.solve(right, X);
  k.stiffness -= k.stiffness * V * X;
  if (k.compliance.allFinite()) k.compliance = inverse(k.stiffness);
}

}  // namespace stiffmap
