// SPDX-License-Identifier: MIT
#include "newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stiffmap {
namespace {

constexpr double trusted_contraction = 0.2;  // of a Newton step against the last one
constexpr double nothing = 1e-15;            // a step that changes no force
constexpr double balanced = 1e-9;  // merit of an equilibrium, in unit deflections of the machine's stiffness and length
constexpr int most_idle = 10;  // Newton steps in which the merit is not halved once: at a singular point each one does

/// A linear deflection below this share of the length is closure noise: the coordinate bears nothing.
constexpr double unloaded = 1e-11;
/// A deflection, of the length, that no gap has: where a drive that only pulls, and is slack, would bear the force.
constexpr double slack = 0.02;
/// The same for the force that a gap would have to bear at an equilibrium: certainly noise, and certainly a force.
constexpr double gap_noise = 1e-15, gap_force = 1e-14;

/// After an iteration with all laws linear: put each law where it carries the force just found besides what it carried
/// before. One that bears nothing stays at its centre, friction opposes the deflection just found: at any share of the
/// load as at the whole of it.
void start_laws(const Mechanism& m, Problem& p, State& state) {
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    const bool bears = std::abs(state.z[j]) * m.unit(j) > unloaded * m.length * p.factor;
    if (c.friction != 0) p.friction_sign[j] = !bears ? 0 : state.z[j] > 0 ? 1 : -1;
    if (c.law < 0 || c.locked) continue;
    const Law& law = m.laws[at(c.law)];
    const double tau = bears ? law.stiffness() / p.drive_scale[j] * state.z[j] : 0.0;
    p.friction_sign[j] = tau > 0 ? 1 : tau < 0 ? -1 : 0;
    const double in_spring = tau - law.friction() * p.friction_sign[j], linear = state.z[j];
    state.z[j] = bears ? law.from_force(law.at(0, p.drive_scale[j]).tau + in_spring, p.drive_scale[j]) : 0.0;
    if (!law.has_knots() || law.sticks()) continue;
    const double far = std::abs(law.at(state.z[j], p.drive_scale[j]).a) * m.unit(j);
    if (far > slack * m.length) state.z[j] = law.from_deflection(linear, p.drive_scale[j]);
  }
}

/// A coordinate inside a gap that has to bear force after all, of more than `noise` of its own stiffness times the
/// length, goes to the end of the gap.
bool leave_gaps(const Mechanism& m, const Problem& p, const Linearization& lin, double noise, State& state) {
  bool left = false;
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.law < 0 || c.locked || lin.kind[at(j)] != Kind::free) continue;
    const Law& law = m.laws[at(c.law)];
    if (std::abs(lin.r[j]) * m.unit(j) <= noise * m.length * law.stiffness()) continue;
    state.z[j] = law.from_force(lin.tau[j] - law.friction() * p.friction_sign[j] - lin.r[j], p.drive_scale[j]);
    left = true;
  }
  return left;
}

/// Halves the step until the merit falls; keeps the shortest if it never does.
void line_search(const Mechanism& m, const Problem& p, EquilibriumWorkspace& ws, State& state, double merit) {
  ws.before = state;
  double share = 1;
  for (int k = 0; k < 8; ++k, share *= 0.5) {
    state.z = ws.before.z + share * ws.dz;
    state.lambda = ws.before.lambda + share * ws.dlambda;
    linearize(m, p, state, ws.lin);
    if (ws.saddle.merit(ws.lin) < (1 - 0.1 * share) * merit) return;
  }
}

/// Newton's steps at one load. `trusting`: leave as soon as the first steps do not shrink fast, so that the
/// result is the continuation of the start and no other root (theory E9). A gap bears what is more than `noise`.
Outcome iterate(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, bool cold, bool trusting, double noise,
                double harmless, EquilibriumWorkspace& ws, State& state, EquilibriumResult& out) {
  const bool knots = has_knots(m);
  bool same_pieces = true;  ///< as before the last step, which went all of its way
  double first = 0, previous = 0, least = std::numeric_limits<double>::infinity();
  int idle = 0;
  out.contraction = 0;
  p.secant_laws = p.first_order = cold && knots;
  if (p.secant_laws) p.friction_sign.setZero();  // not those of an attempt at more of the load
  linearize(m, p, state, ws.lin);
  ws.pieces = ws.lin.dtau;
  for (int k = 0; k < opt.max_iterations; ++k) {
    if ((knots || !trusting) && off_locks(m, p, state)) linearize(m, p, state, ws.lin);
    ws.saddle.assemble(m, ws.lin);
    ws.saddle.factorize();
    force_balance(m, ws.lin, ws.saddle, ws.force);
    ws.saddle.solve(ws.force, ws.lin.e, ws.dz, ws.dlambda);
    ws.met_gap |= knots && !ws.saddle.regular();
    ++out.iterations;
    const double norm = ws.saddle.step_norm(m, ws.dz);
    if (!std::isfinite(norm)) return Outcome::failed;
    if (p.secant_laws) {
      state.z += ws.dz;
      state.lambda += ws.dlambda;
      start_laws(m, p, state);
      p.secant_laws = p.first_order = false;
      linearize(m, p, state, ws.lin);
      ws.pieces = ws.lin.dtau;
      continue;
    }
    if (first > 0 && out.contraction == 0 && same_pieces) out.contraction = norm / first;
    // A short step may still cross a corner, after which the force is another: two in a row do not.
    const bool settled =
        norm < opt.tolerance && (!knots || norm < nothing || (previous > 0 && previous < opt.tolerance));
    if (settled) {
      if (knots && !ws.saddle.regular() && leave_gaps(m, p, ws.lin, noise, state)) {
        linearize(m, p, state, ws.lin);
        continue;
      }
      if (!ws.saddle.regular() && !in_balance(m, ws)) return trusting ? Outcome::distrusted : Outcome::failed;
      state.z += ws.dz;
      state.lambda += ws.dlambda;
      return Outcome::converged;
    }
    if (trusting) {
      if (first == 0) first = norm;
      if (norm > largest_step && !knots) return Outcome::distrusted;
      const bool shrinks = norm <= trusted_contraction * previous || norm <= harmless;
      if (previous > 0 && same_pieces && !shrinks && (!knots || ws.saddle.regular())) return Outcome::distrusted;
    }
    previous = norm;
    const double merit = ws.saddle.merit(ws.lin);
    idle = merit < 0.5 * least ? 0 : idle + 1;
    if (merit < 0.5 * least) least = merit;
    const bool last_attempt = !trusting && !knots && opt.load_steps == 0;
    if (last_attempt && idle > most_idle && !in_balance(m, ws)) return Outcome::failed;  // it wanders
    ws.before = state;
    state.z += ws.dz;
    state.lambda += ws.dlambda;
    linearize(m, p, state, ws.lin);
    same_pieces = !knots || !at_other_pieces(m, ws.lin, ws.pieces);
    ws.pieces = ws.lin.dtau;
    // The merit mixes closure and force: far steps may raise it harmlessly once, so only guard
    // against growth when the steps have stopped shrinking.
    if ((knots || !trusting) && k > 2 && !(ws.saddle.merit(ws.lin) < 2 * merit)) {
      state = ws.before;
      line_search(m, p, ws, state, merit);
      same_pieces = false;
    }
  }
  return Outcome::failed;
}

}  // namespace

bool rubs_or_sticks(const Mechanism& m) {
  return std::any_of(m.coordinates.begin(), m.coordinates.end(), [](const Coordinate& c) { return c.friction != 0; }) ||
         std::any_of(m.laws.begin(), m.laws.end(), [](const Law& law) { return law.sticks() || law.friction() != 0; });
}

bool has_knots(const Mechanism& m) {
  if (rubs_or_sticks(m)) return true;
  return std::any_of(m.laws.begin(), m.laws.end(), [](const Law& law) { return law.has_knots(); });
}

bool at_other_pieces(const Mechanism& m, const Linearization& lin, const VecX& slopes) {
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.law >= 0 && !c.locked && m.laws[at(c.law)].has_knots() && slopes[j] != lin.dtau[j]) return true;
  }
  return false;
}

bool off_locks(const Mechanism& m, const Problem& p, State& state) {
  const auto is_narrow = [&](const Ball& b) {
    const Index second = b.first + 1;
    return b.free && b.spread(p.base[second] + state.z[second]) < narrow;
  };
  if (std::none_of(m.balls.begin(), m.balls.end(), is_narrow)) return false;
  VecX x = p.base + state.z;
  const VecX before = x;
  if (!keep_off_locks(m, x, state.charts)) return false;
  for (const Ball& b : m.balls) state.z.segment<3>(b.first) += x.segment<3>(b.first) - before.segment<3>(b.first);
  return true;
}

void factorize_at(const Mechanism& m, const Problem& p, const State& state, EquilibriumWorkspace& ws) {
  linearize(m, p, state, ws.lin);
  ws.saddle.assemble(m, ws.lin);
  ws.saddle.factorize();
}

void force_balance(const Mechanism& m, const Linearization& lin, const SaddleSystem& saddle, VecX& force) {
  for (Index j = 0; j < m.size(); ++j) {
    force[j] = -lin.da[j] * lin.r[j];
    if (lin.kind[at(j)] != Kind::fixed) continue;
    const bool stuck = lin.dtau[j] > 0 && !m.coordinates[at(j)].locked;
    force[j] = stuck ? -lin.r[j] / (lin.dtau[j] * saddle.scale()[j] * saddle.scale()[j]) : 0.0;
  }
}

bool in_balance(const Mechanism& m, const EquilibriumWorkspace& ws) {
  return ws.saddle.merit(ws.lin) < balanced * std::sqrt(m.stiffness) * m.length;
}

Outcome newton(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, bool cold, bool trusting,
               EquilibriumWorkspace& ws, State& state, EquilibriumResult& out, double harmless) {
  const Outcome outcome = iterate(m, p, opt, cold, trusting, gap_force, harmless, ws, state, out);
  if (outcome != Outcome::converged || !has_knots(m) || ws.saddle.regular()) return outcome;
  ws.settled = state;
  if (!leave_gaps(m, p, ws.lin, gap_noise, state)) return outcome;
  if (iterate(m, p, opt, false, false, gap_noise, harmless, ws, state, out) == Outcome::converged) return outcome;
  state = ws.settled;
  factorize_at(m, p, state, ws);
  return outcome;
}

}  // namespace stiffmap
