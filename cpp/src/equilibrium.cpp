// SPDX-License-Identifier: MIT
#include "stiffmap/equilibrium.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stiffmap {
namespace {

constexpr double trusted_contraction = 0.2;  // of a Newton step against the last one
constexpr double steady_contraction = 0.1;   // of the second against the first: no further proof is needed
constexpr double shortest_load_step = 1.0 / 16384;
constexpr double crossing_step = 1.0 / 1024;  // a change of stability is looked at this closely
constexpr double trusted_bend = 0.1;          // of a load step: its chord against the tangents at its ends
constexpr double crossing_bend = 1e-3, bend_noise = 1e-9;
constexpr double nothing = 1e-15;  // a step that changes no force
constexpr double balanced = 1e-9;  // merit of an equilibrium, in unit deflections of the machine's stiffness and length
constexpr int most_load_steps = 400;
constexpr int patient_steps = 8;
constexpr int most_idle = 10;  // Newton steps in which the merit is not halved once: at a singular point each one does

/// A linear deflection below this share of the length is closure noise: the coordinate bears nothing.
constexpr double unloaded = 1e-11;
/// The same for the force that a gap would have to bear at an equilibrium: certainly noise, and certainly a force.
constexpr double gap_noise = 1e-15, gap_force = 1e-14;

/// After an iteration with all laws linear: put each law where it carries the force just found. One
/// that bears nothing stays at its centre, friction opposes the deflection just found: at any share of the load as at
/// the whole of it.
void start_laws(const Mechanism& m, Problem& p, State& state) {
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    const bool bears = std::abs(state.z[j]) * m.unit(j) > unloaded * m.length * p.factor;
    if (c.friction != 0) p.friction_sign[j] = !bears ? 0 : state.z[j] > 0 ? 1 : -1;
    if (c.law < 0 || c.locked) continue;
    const Law& law = m.laws[at(c.law)];
    const double tau = bears ? law.stiffness() / p.drive_scale[j] * state.z[j] : 0.0;
    p.friction_sign[j] = tau > 0 ? 1 : tau < 0 ? -1 : 0;
    const double in_spring = tau - law.friction() * p.friction_sign[j];
    state.z[j] = bears ? law.from_force(in_spring, p.drive_scale[j]) : 0.0;
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

/// Forces balance and loops are closed: a vanishing step alone says nothing where the tangent is singular.
bool in_balance(const Mechanism& m, const EquilibriumWorkspace& ws) {
  return ws.saddle.merit(ws.lin) < balanced * std::sqrt(m.stiffness) * m.length;
}

enum class Outcome { converged, failed, distrusted };

/// Counts where the determinant changed sign since the last converged load step.
void count_sign(const SaddleSystem& saddle, double& sign, EquilibriumResult& out) {
  if (!saddle.regular()) return;
  if (sign != 0 && sign != saddle.determinant_sign()) ++out.sign_changes;
  sign = saddle.determinant_sign();
}

/// Sign of the determinant before any load.
double unloaded_sign(const Mechanism& m, Problem& p, EquilibriumWorkspace& ws, const State& state) {
  if (!p.is_nonconservative()) return 0;
  p.factor = 0;
  factorize_at(m, p, state, ws);
  return ws.saddle.regular() ? ws.saddle.determinant_sign() : 0;
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
                EquilibriumWorkspace& ws, State& state, EquilibriumResult& out) {
  const bool knots = has_knots(m);
  double first = 0, previous = 0, least = std::numeric_limits<double>::infinity();
  int idle = 0;
  out.contraction = 0;
  p.secant_laws = p.first_order = cold && knots;
  if (p.secant_laws) p.friction_sign.setZero();  // not those of an attempt at more of the load
  linearize(m, p, state, ws.lin);
  for (int k = 0; k < opt.max_iterations; ++k) {
    ws.saddle.assemble(m, ws.lin);
    ws.saddle.factorize();
    force_balance(m, ws.lin, ws.saddle, ws.force);
    ws.saddle.solve(ws.force, ws.lin.e, ws.dz, ws.dlambda);
    ++out.iterations;
    const double norm = ws.saddle.step_norm(m, ws.dz);
    if (!std::isfinite(norm)) return Outcome::failed;
    if (p.secant_laws) {
      state.z += ws.dz;
      state.lambda += ws.dlambda;
      start_laws(m, p, state);
      p.secant_laws = p.first_order = false;
      linearize(m, p, state, ws.lin);
      continue;
    }
    if (first > 0 && out.contraction == 0) out.contraction = norm / first;
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
    if (trusting && !knots) {
      if (first == 0) first = norm;
      if (norm > largest_step) return Outcome::distrusted;
      if (previous > 0 && norm > trusted_contraction * previous && norm > 1e-7) return Outcome::distrusted;
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
    // The merit mixes closure and force: far steps may raise it harmlessly once, so only guard
    // against growth when the steps have stopped shrinking.
    if ((knots || !trusting) && k > 2 && !(ws.saddle.merit(ws.lin) < 2 * merit)) {
      state = ws.before;
      line_search(m, p, ws, state, merit);
    }
  }
  return Outcome::failed;
}

/// Newton at one load. Whether a gap bears a force next to round-off is found by trying: where Newton does not settle
/// with it, it was noise.
Outcome newton(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, bool cold, bool trusting,
               EquilibriumWorkspace& ws, State& state, EquilibriumResult& out) {
  const Outcome outcome = iterate(m, p, opt, cold, trusting, gap_force, ws, state, out);
  if (outcome != Outcome::converged || !has_knots(m) || ws.saddle.regular()) return outcome;
  ws.settled = state;
  if (!leave_gaps(m, p, ws.lin, gap_noise, state)) return outcome;
  if (iterate(m, p, opt, false, trusting, gap_noise, ws, state, out) == Outcome::converged) return outcome;
  state = ws.settled;
  factorize_at(m, p, state, ws);
  return outcome;
}

Outcome equal_steps(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, int steps, EquilibriumWorkspace& ws,
                    State& state, EquilibriumResult& out) {
  double sign = unloaded_sign(m, p, ws, state);
  for (int k = 1; k <= steps; ++k) {
    p.factor = static_cast<double>(k) / steps;
    if (newton(m, p, opt, k == 1, false, ws, state, out) != Outcome::converged) return Outcome::failed;
    count_sign(ws.saddle, sign, out);
  }
  return Outcome::converged;
}

/// d z / d (share of the load) at the last linearisation, which must be factorised.
void load_slope(const Mechanism& m, const Problem& p, EquilibriumWorkspace& ws, VecX& slope) {
  ws.force.setZero();
  const auto add = [&](Index node, const Vec3& at_point, const Vec3& f, const Vec3& moment) {
    for (const Index j : m.path[at(node)]) {
      const Vec6 c = column(m, ws.lin.frames, j, at_point);
      ws.force[j] += c.head<3>().dot(f) + c.tail<3>().dot(moment);
    }
  };
  for (std::size_t i = 0; i < p.load_points.size(); ++i) {
    const LoadPoint& load = p.load_points[i];
    const Vec6 w = p.wrench_at(i, ws.lin.frames.at(load.node).R);
    add(load.node, ws.lin.frames.point(load.node, load.offset), w.head<3>(), w.tail<3>());
  }
  for (const NodeBody& b : m.bodies) add(b.node, ws.lin.frames.point(b.node, b.com), b.mass * p.gravity, Vec3::Zero());
  for (Index j = 0; j < m.size(); ++j) ws.force[j] *= ws.lin.kind[at(j)] == Kind::fixed ? 0.0 : ws.lin.da[j];
  ws.saddle.solve(ws.force, ws.no_closure, slope, ws.dlambda);
}

/// Steps of the load from the unloaded equilibrium, each proven to stay on the path (theory E9).
class LoadPath {
 public:
  LoadPath(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws, State& state,
           EquilibriumResult& out)
      : m_(m), p_(p), opt_(opt), ws_(ws), state_(state), out_(out), by_sign_(p.is_nonconservative()) {}

  /// All of the load at once, where Newton's steps shrink so fast that there is no doubt.
  bool at_once() {
    p_.factor = 1;
    if (newton(m_, p_, opt_, true, true, ws_, state_, out_) != Outcome::converged) return false;
    out_.falling = ws_.stability.falling(ws_.saddle);
    return out_.falling == 0 && out_.contraction <= steady_contraction;
  }

  Outcome follow() {
    out_.flags |= flag::load_stepped;
    p_.factor = 0;
    if (newton(m_, p_, opt_, true, false, ws_, state_, out_) != Outcome::converged) return Outcome::failed;
    note(stable_, ws_.slope_before);
    double done = 0, step = 0.5;
    for (int k = 0; k < most_load_steps; ++k) {
      p_.factor = std::min(1.0, done + step);
      if (advance(p_.factor - done)) {
        if (done = p_.factor; done == 1) return Outcome::converged;
        step *= 2;
        continue;
      }
      state_ = ws_.step_start;
      step = 0.5 * (p_.factor - done);
      if (step < shortest_load_step) return Outcome::failed;
    }
    return Outcome::failed;
  }

 private:
  const Mechanism& m_;
  Problem& p_;
  const EquilibriumOptions& opt_;
  EquilibriumWorkspace& ws_;
  State& state_;
  EquilibriumResult& out_;
  bool by_sign_;       ///< stability by the determinant's sign
  double stable_ = 0;  ///< at the start of the step: falling directions, or the determinant's sign

  void note(double& stable, VecX& slope) {
    load_slope(m_, p_, ws_, slope);
    out_.falling = ws_.stability.falling(ws_.saddle);
    if (!by_sign_) stable = static_cast<double>(out_.falling);
    else stable = ws_.saddle.regular() ? ws_.saddle.determinant_sign() : stable_;
  }

  bool advance(double step) {
    ws_.step_start = state_;
    if (newton(m_, p_, opt_, false, true, ws_, state_, out_) != Outcome::converged) return false;
    double stable = 0;
    note(stable, ws_.slope);
    // The chord against the mean of the tangents at both ends: on another branch they disagree.
    ws_.dz = state_.z - ws_.step_start.z;
    const double chord = ws_.saddle.step_norm(m_, ws_.dz);
    ws_.dz -= 0.5 * step * (ws_.slope + ws_.slope_before);
    const double bend = ws_.saddle.step_norm(m_, ws_.dz);
    const bool crossed = stable != stable_;
    if (crossed && step > crossing_step) return false;
    if (!(bend <= bend_noise + (crossed ? crossing_bend : trusted_bend) * chord)) return false;
    out_.sign_changes += by_sign_ && crossed;
    stable_ = stable;
    ws_.slope_before = ws_.slope;
    return true;
  }
};

/// Laws with corners: the path has corners too, so that of a step only convergence is asked, and that the tip does not
/// leap to another assembly.
Outcome steps_with_corners(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws,
                           State& state, EquilibriumResult& out) {
  double done = 0, step = 1, sign = unloaded_sign(m, p, ws, state);
  linearize(m, p, state, ws.lin);
  Vec3 tip = ws.lin.frames.at(m.tip).p;
  while (done < 1) {
    p.factor = std::min(1.0, done + step);
    ws.step_start = state;
    const bool found = newton(m, p, opt, done == 0, true, ws, state, out) == Outcome::converged;
    const Vec3 moved = ws.lin.frames.at(m.tip).p;
    if (found && !leaps(m, moved - tip)) {
      done = p.factor;
      tip = moved;
      count_sign(ws.saddle, sign, out);
      step *= 2;
      continue;
    }
    out.flags |= flag::load_stepped;
    state = ws.step_start;
    step *= 0.5;
    if (step < 1.0 / 1024) return Outcome::failed;
  }
  out.falling = ws.stability.falling(ws.saddle);
  return Outcome::converged;
}

Outcome adaptive_steps(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws,
                       State& state, EquilibriumResult& out) {
  if (has_knots(m)) return steps_with_corners(m, p, opt, ws, state, out);
  LoadPath path(m, p, opt, ws, state, out);
  if (path.at_once()) return Outcome::converged;
  state = ws.start;
  return path.follow();
}

}  // namespace

bool has_knots(const Mechanism& m) {
  const auto has_friction = [](const Coordinate& c) { return c.friction != 0; };
  if (std::any_of(m.coordinates.begin(), m.coordinates.end(), has_friction)) return true;
  return std::any_of(m.laws.begin(), m.laws.end(),
                     [](const Law& law) { return law.has_knots() || law.friction() != 0; });
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

EquilibriumWorkspace::EquilibriumWorkspace(const Mechanism& m)
    : lin(m),
      saddle(m),
      start(m),
      step_start(m),
      before(m),
      settled(m),
      dz(VecX::Zero(m.size())),
      dlambda(VecX::Zero(m.closures())),
      force(VecX::Zero(m.size())),
      slope(VecX::Zero(m.size())),
      slope_before(VecX::Zero(m.size())),
      no_closure(VecX::Zero(m.closures())) {}

EquilibriumResult solve_equilibrium(const Mechanism& m, Problem& problem, const EquilibriumOptions& options,
                                    EquilibriumWorkspace& ws, State& state) {
  EquilibriumResult out;
  Outcome how;
  if (options.load_steps > 0) {
    how = equal_steps(m, problem, options, options.load_steps, ws, state, out);
    out.falling = -1;
  } else {
    ws.start = state;
    how = options.path_ends ? Outcome::failed : adaptive_steps(m, problem, options, ws, state, out);
    if (options.path_ends) out.flags |= flag::load_stepped;
    if (how != Outcome::converged) {  // next to a singular pose Newton is slow but finds its way
      state = ws.start;
      out.sign_changes = 0;
      how = equal_steps(m, problem, options, patient_steps, ws, state, out);
      out.flags |= flag::branch_unverified;
      out.falling = -1;
    }
  }
  problem.factor = 1;
  if (how != Outcome::converged) return out;
  factorize_at(m, problem, state, ws);
  if (!in_balance(m, ws)) return out;
  if (out.falling < 0) out.falling = ws.stability.falling(ws.saddle);
  out.status = Status::converged;
  return out;
}

}  // namespace stiffmap
