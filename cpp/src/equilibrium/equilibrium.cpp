// SPDX-License-Identifier: MIT
#include "stiffmap/equilibrium/equilibrium.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "downhill.hpp"
#include "newton.hpp"
#include "stiffmap/equilibrium/floating.hpp"

namespace stiffmap {
namespace {

constexpr double steady_contraction = 0.1;  // of the second against the first: no further proof is needed
constexpr double shortest_load_step = 1.0 / 16384;
constexpr double crossing_step = 1.0 / 1024;  // a change of stability is looked at this closely
constexpr double trusted_bend = 0.1;          // of a load step: its chord against the tangents at its ends
constexpr double crossing_bend = 1e-3, bend_noise = 1e-9;
constexpr double short_of_way = 1e-2;     // a correction of so little of the step's way leads to no other branch
constexpr double short_share = 1.0 / 64;  // of the load, across a corner
constexpr int most_load_steps = 400, most_across = 60;  // the latter with corners
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
      : m_(m),
        p_(p),
        opt_(opt),
        ws_(ws),
        state_(state),
        out_(out),
        by_sign_(p.is_nonconservative()),
        corners_(has_knots(m)) {}

  /// All of the load at once, where Newton's steps shrink so fast that there is no doubt.
  bool at_once() {
    ws_.met_gap = false;
    if (!take(1, true, true)) return false;
    out_.falling = ws_.stability.falling(ws_.saddle);
    return out_.falling == 0 && out_.contraction <= steady_contraction;
  }

  Outcome follow() {
    out_.flags |= flag::load_stepped;
    double done = corners_ ? 1 : 0, step = 0.5;
    if (corners_) {  // what a law with corners does without a load says nothing
      while (done *= 0.5, !take(done, true, true) || ws_.stability.falling(ws_.saddle) > 0) {
        state_ = ws_.start;
        if (done < shortest_load_step) return Outcome::failed;
      }
      step = done;
    } else if (p_.factor = 0; newton(m_, p_, opt_, true, false, ws_, state_, out_) != Outcome::converged) {
      state_ = ws_.start;  // springs that pull without a load
      if (!settle_downhill(m_, p_, opt_.tolerance, ws_, state_, out_)) return Outcome::failed;
      factorize_at(m_, p_, state_, ws_);
    }
    note(stable_, ws_.slope_before, wrench_slope_before_);
    if (!corners_ && unloaded()) return Outcome::converged;
    falling_ = out_.falling;
    ws_.pieces_before = ws_.lin.dtau;
    for (int k = 0; k < (corners_ ? most_across : most_load_steps); ++k) {
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

  /// Across corners that no step is proven to pass, where a gap is open or something sticks: of each is asked only that
  /// Newton converges and that the tip does not leap.
  Outcome step_over_corners() {
    state_ = ws_.start;
    out_.sign_changes = 0;
    double done = 0, step = 1, sign = unloaded_sign(m_, p_, ws_, state_);
    while (done < 1) {
      ws_.step_start = state_;
      if (take(std::min(1.0, done + step), done == 0, false)) {
        done = p_.factor;
        count_sign(ws_.saddle, sign, out_);
        step *= 2;
        continue;
      }
      out_.flags |= flag::load_stepped;
      state_ = ws_.step_start;
      step *= 0.5;
      if (step < 1.0 / 1024) return Outcome::failed;
    }
    out_.falling = ws_.stability.falling(ws_.saddle);
    return Outcome::converged;
  }

 private:
  const Mechanism& m_;
  Problem& p_;
  const EquilibriumOptions& opt_;
  EquilibriumWorkspace& ws_;
  State& state_;
  EquilibriumResult& out_;
  bool by_sign_;       ///< stability by the determinant's sign
  bool corners_;       ///< of laws: where one is met, the path bends at once
  double stable_ = 0;  ///< at the start of the step: falling directions, or the determinant's sign
  Index falling_ = 0;
  VecX wrench_slope_, wrench_slope_before_;  ///< of the loops

  bool unloaded() const {
    const auto none = [](const Vec6& w) { return w.isZero(0); };
    return p_.gravity.isZero(0) && std::all_of(p_.wrenches.begin(), p_.wrenches.end(), none);
  }

  /// A share of the load at once: from the command, or from the last step.
  bool take(double share, bool cold, bool trusting) {
    linearize(m_, p_, state_, ws_.lin);
    const Pose tip = ws_.lin.frames.at(m_.tip);
    p_.factor = share;
    if (newton(m_, p_, opt_, cold, trusting, ws_, state_, out_) != Outcome::converged) return false;
    return !corners_ || !leaps(m_, tip, ws_.lin.frames.at(m_.tip));
  }

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
    falling_ = out_.falling;
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
    const bool bends = corners_ && at_other_pieces(m_, ws_.lin, ws_.pieces_before);
    // The chord against the mean of the tangents at both ends: on another branch they disagree.
    ws_.dz = state_.z - ws_.step_start.z;
    const double chord = ws_.saddle.step_norm(m_, ws_.dz);
    ws_.dz -= 0.5 * step * (ws_.slope + ws_.slope_before);
    const double bend = ws_.saddle.step_norm(m_, ws_.dz);
    const bool near = bends && step <= short_share;
    // Two that fall at once, as in a symmetric machine, leave the determinant's sign.
    const bool turned = stable != stable_, crossed = (turned || out_.falling != falling_) && !near;
    if (crossed && step > crossing_step) return false;
    if (!near && !(bend <= bend_noise + (crossed ? crossing_bend : trusted_bend) * chord)) return false;
    out_.sign_changes += by_sign_ && turned && !near;
    stable_ = stable;
    falling_ = out_.falling;
    ws_.slope_before = ws_.slope;
    wrench_slope_before_ = wrench_slope_;
    ws_.pieces_before = ws_.lin.dtau;
    return true;
  }
};

/// Where the path has corners that no step is proven to pass: the whole load at once, where that needs it by way of
/// least energy. Where the tip leaps it is not taken, or flagged if there is no other way.
bool across_corners(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws,
                    State& state, EquilibriumResult& out, bool only_way) {
  state = ws.start;
  out.sign_changes = 0;
  out.flags &= ~flag::load_stepped;
  p.factor = 1;
  linearize(m, p, state, ws.lin);
  const Pose tip = ws.lin.frames.at(m.tip);
  EquilibriumOptions few = opt;
  few.max_iterations = std::min(opt.max_iterations, few_iterations);
  const bool found = newton(m, p, few, true, false, ws, state, out) == Outcome::converged;
  out.falling = found ? ws.stability.falling(ws.saddle) : 1;
  if (out.falling > 0) {
    state = ws.start;
    if (!settle_downhill(m, p, opt.tolerance, ws, state, out)) return false;
    factorize_at(m, p, state, ws);
    out.falling = ws.stability.falling(ws.saddle);
  }
  const bool far = leaps(m, tip, ws.lin.frames.at(m.tip));
  if (far && only_way) out.flags |= flag::branch_unverified;
  return out.falling == 0 && (only_way || !far);
}

Outcome adaptive_steps(const Mechanism& m, Problem& p, const EquilibriumOptions& opt, EquilibriumWorkspace& ws,
                       State& state, EquilibriumResult& out) {
  LoadPath path(m, p, opt, ws, state, out);
  if (path.at_once()) return Outcome::converged;
  state = ws.start;
  if (!ws.met_gap && path.follow() == Outcome::converged) return Outcome::converged;
  const auto slackens = [](const NodeSpring& s) { return s.tension_only; };
  const bool knots = has_knots(m), slides = knots && !rubs_or_sticks(m);
  if (slides && across_corners(m, p, opt, ws, state, out, false)) return Outcome::converged;
  if (knots && path.step_over_corners() == Outcome::converged) return Outcome::converged;
  const bool only_way = slides || std::any_of(m.external_springs.begin(), m.external_springs.end(), slackens);
  return only_way && across_corners(m, p, opt, ws, state, out, true) ? Outcome::converged : Outcome::failed;
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
