// SPDX-License-Identifier: MIT
#include "stiffmap/equilibrium.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "downhill.hpp"
#include "newton.hpp"
#include "stiffmap/floating.hpp"

namespace stiffmap {
namespace {

constexpr double steady_contraction = 0.1;  // of the second against the first: no further proof is needed
constexpr double shortest_load_step = 1.0 / 16384;
constexpr double crossing_step = 1.0 / 1024;  // a change of stability is looked at this closely
constexpr double trusted_bend = 0.1;          // of a load step: its chord against the tangents at its ends
constexpr double crossing_bend = 1e-3, bend_noise = 1e-9;
constexpr double short_of_way = 1e-2;  // a correction of so little of the step's way leads to no other branch
constexpr int most_load_steps = 400;
constexpr int patient_steps = 8;
constexpr int few_iterations = 12;  // of whole steps across corners: they end soon or go to and fro

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
    if (newton(m_, p_, opt_, true, false, ws_, state_, out_) !=
        Outcome::converged) {  // springs that pull without a load
      state_ = ws_.start;
      if (!settle_downhill(m_, p_, opt_.tolerance, ws_, state_, out_)) return Outcome::failed;
      factorize_at(m_, p_, state_, ws_);
    }
    note(stable_, ws_.slope_before, wrench_slope_before_);
    double done = 0, step = 0.5;
    for (int k = 0; k < most_load_steps; ++k) {
      p_.factor = std::min(1.0, done + step);
      if (advance(p_.factor - done)) {
        if (done = p_.factor; done == 1) return Outcome::converged;
        step *= 2;
        renumber();
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
  VecX wrench_slope_, wrench_slope_before_;  ///< of the loops

  void note(double& stable, VecX& slope, VecX& wrench_slope) {
    load_slope(m_, p_, ws_, slope);
    wrench_slope = ws_.dlambda;
    out_.falling = ws_.stability.falling(ws_.saddle);
    if (!by_sign_) stable = static_cast<double>(out_.falling);
    else stable = ws_.saddle.regular() ? ws_.saddle.determinant_sign() : stable_;
  }

  /// Before a step: within it, its chord and the tangents at its ends count by the same axes.
  void renumber() {
    if (!off_locks(m_, p_, state_)) return;
    factorize_at(m_, p_, state_, ws_);
    note(stable_, ws_.slope_before, wrench_slope_before_);
  }

  bool advance(double step) {
    ws_.step_start = state_;
    // From the end of the tangent: where stiff springs turn far, Newton's steps from its start shrink only if they are
    // tiny.
    ws_.dz = step * ws_.slope_before;
    const double way = ws_.saddle.step_norm(m_, ws_.dz);
    if (!(way < largest_step)) return false;
    state_.z += ws_.dz;
    state_.lambda += step * wrench_slope_before_;
    if (newton(m_, p_, opt_, false, true, ws_, state_, out_, std::max(1e-7, short_of_way * way)) != Outcome::converged)
      return false;
    double stable = 0;
    note(stable, ws_.slope, wrench_slope_);
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
    wrench_slope_before_ = wrench_slope_;
    return true;
  }
};

/// Laws with corners: the path has corners too, so that of a step only convergence is asked, and that the tip does not
/// leap to another assembly.
Outcome steps_with_corners(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws,
                           State& state, EquilibriumResult& out) {
  double done = 0, step = 1, sign = unloaded_sign(m, p, ws, state);
  linearize(m, p, state, ws.lin);
  Pose tip = ws.lin.frames.at(m.tip);
  while (done < 1) {
    p.factor = std::min(1.0, done + step);
    ws.step_start = state;
    const bool found = newton(m, p, opt, done == 0, true, ws, state, out) == Outcome::converged;
    const Pose moved = ws.lin.frames.at(m.tip);
    if (found && !leaps(m, tip, moved)) {
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

/// Laws with corners of which none sticks: the whole load at once, where that needs it by way of least energy. Where
/// the tip leaps it is not taken, or flagged if there is no other way.
bool at_once_with_corners(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws,
                          State& state, EquilibriumResult& out, bool only_way) {
  p.factor = 1;
  EquilibriumOptions few = opt;
  few.max_iterations = std::min(opt.max_iterations, few_iterations);
  linearize(m, p, state, ws.lin);
  const Pose tip = ws.lin.frames.at(m.tip);
  const auto found = [&] {
    out.falling = ws.stability.falling(ws.saddle);
    const bool far = leaps(m, tip, ws.lin.frames.at(m.tip));
    if (far && only_way) out.flags |= flag::branch_unverified;
    return out.falling == 0 && (only_way || !far);
  };
  if (newton(m, p, few, true, true, ws, state, out) == Outcome::converged && found()) return true;
  state = ws.start;
  if (!settle_downhill(m, p, opt.tolerance, ws, state, out)) return false;
  factorize_at(m, p, state, ws);
  return found();
}

Outcome adaptive_steps(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws,
                       State& state, EquilibriumResult& out) {
  const auto at_once = [&](bool only_way) {
    state = ws.start;
    out.sign_changes = 0;
    return at_once_with_corners(m, p, opt, ws, state, out, only_way) ? Outcome::converged : Outcome::failed;
  };
  if (has_knots(m)) {
    const bool slides = !rubs_or_sticks(m);
    if (slides && at_once(false) == Outcome::converged) return Outcome::converged;
    state = ws.start;
    const Outcome stepped = steps_with_corners(m, p, opt, ws, state, out);
    return slides && stepped != Outcome::converged ? at_once(true) : stepped;
  }
  LoadPath path(m, p, opt, ws, state, out);
  if (path.at_once()) return Outcome::converged;
  state = ws.start;
  const Outcome followed = path.follow();
  const auto slackens = [](const NodeSpring& s) { return s.tension_only; };
  if (followed == Outcome::converged || std::none_of(m.external_springs.begin(), m.external_springs.end(), slackens))
    return followed;
  return at_once(true);  // the path has a corner where one of them goes slack
}

/// A platform in cables alone: the minimum of the energy that lies downhill, then Newton's last steps.
Outcome float_down(const Mechanism& m, Problem& p, EquilibriumWorkspace& ws, State& state, EquilibriumResult& out) {
  p.factor = 1;
  const FloatingResult found = find_floating(m, p, ws.slope);
  out.iterations = found.iterations;
  if (found.leapt) out.flags |= flag::branch_unverified;
  if (!found.found) return Outcome::failed;
  for (const Index j : m.path[at(m.tip)]) state.z[j] = ws.slope[j] - p.base[j];
  out.falling = -1;
  return Outcome::converged;
}

}  // namespace

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
  if (m.floating) {
    how = float_down(m, problem, ws, state, out);
  } else if (options.load_steps > 0) {
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
  off_locks(m, problem, state);
  factorize_at(m, problem, state, ws);
  if (!in_balance(m, ws)) return out;
  if (out.falling < 0) out.falling = ws.stability.falling(ws.saddle);
  out.status = Status::converged;
  return out;
}

}  // namespace stiffmap
