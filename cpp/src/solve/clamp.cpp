// SPDX-License-Identifier: MIT
#include "stiffmap/solve/clamp.hpp"

#include <cmath>

namespace stiffmap {
namespace {

constexpr double shortest_held_step = 1.0 / 256;  // of the imposed displacement
constexpr int few_in_a_step = 8;                  // of a step that is trusted to stay on its branch

void add_frame(Mechanism& m, Index parent, const Vec3& offset) {
  const Pose shift{offset, Mat3::Identity()};
  m.nodes.push_back({parent, shift, shift, -1, JointType::revolute, Vec3::UnitZ()});
  m.path.push_back(m.path[at(parent)]);
  m.beyond_legs.push_back(m.beyond_legs[at(parent)]);
}

/// One more loop: the point against a frame of the base that the clamp moves.
Mechanism with_clamp(Mechanism m, const NodePoint& point) {
  add_frame(m, 0, Vec3::Zero());
  add_frame(m, point.node, point.offset);
  const Index end = static_cast<Index>(m.nodes.size()) - 1;
  m.loops.push_back({"clamp", point.name, end - 1, end, false, "clamp"});
  m.floating = false;  // the clamp carries what hangs in cables
  return m;
}

Vec6 loop_wrench(const State& state, Index loop) { return state.lambda.segment<6>(6 * loop); }

}  // namespace

Clamp::Clamp(const Mechanism& machine, Index point)
    : machine_(machine),
      point_(machine.points[at(point)]),
      held_(with_clamp(machine, point_)),
      frame_(held_.nodes.size() - 2),
      ws_(machine),
      eq_(held_),
      state_(held_),
      before_(held_) {
  ws_.problem.misfit.setZero(held_.closures());  // the same problem is solved with the clamp's loop
}

/// Newton with the point at `pose`; false where it does not get there.
bool Clamp::hold(const Pose& pose, Problem& problem) {
  held_.nodes[frame_].nominal = held_.nodes[frame_].actual = pose;
  EquilibriumOptions options;
  options.load_steps = 1;
  const EquilibriumResult eq = solve_equilibrium(held_, problem, options, eq_, state_);
  // Least squares may settle at a pose that rigid parts do not allow.
  return eq.status == Status::converged && eq.iterations <= few_in_a_step &&
         eq_.lin.e.cwiseAbs().maxCoeff() < 1e-8 * machine_.length;
}

/// Moves the point from its commanded pose to the imposed one in as few steps as are trusted.
bool Clamp::follow(const Vec6& displacement, Problem& problem) {
  const Pose from = ws_.nominal.at(point_.node) * Pose{point_.offset, Mat3::Identity()};
  const auto way = [&](double s) {
    return Pose{from.p + s * displacement.head<3>(), exp_so3(s * displacement.tail<3>()) * from.R};
  };
  double done = -1, leap = 1;  // -1: nothing is held yet
  while (done < 1) {
    const double s = done < 0 ? 0 : std::min(1.0, done + leap);
    before_ = state_;
    if (hold(way(s), problem)) {
      done = s;
      leap *= 2;
      continue;
    }
    state_ = before_;
    leap *= 0.5;
    if (done < 0 || leap < shortest_held_step) return false;
  }
  return true;
}

/// Derivative of what each leg does at the point: from one tangent with the clamp moved along each axis.
void Clamp::leg_stiffness(ClampResult& out) {
  const Index loops = static_cast<Index>(held_.loops.size()), clamp = loops - 1;
  const Vec3 p = eq_.lin.frames.at(held_.loops.back().end).p;
  out.leg_stiffness.assign(machine_.legs.size(), Mat6::Zero());
  if (machine_.legs.empty()) return;
  MatX J(6, held_.size());
  VecX dz, dlambda, closure = VecX::Zero(6 * loops);
  for (int k = 0; k < 6; ++k) {
    closure.setZero();
    closure[6 * clamp + k] = -1;
    eq_.saddle.solve(VecX::Zero(held_.size()), closure, dz, dlambda);
    for (Index j = 0; j < held_.size(); ++j) dz[j] *= eq_.lin.da[j];
    Vec3 dp = Vec3::Zero();
    if (k < 3) dp[k] = 1;
    // How the wrench of a loop, at its end, changes about the point; inside a loop half of the moment
    // follows the frames (theory E5).
    const auto change = [&](Index loop) {
      const Loop& l = held_.loops[at(loop)];
      const Vec6 w = loop_wrench(state_, loop), dw = dlambda.segment<6>(6 * loop);
      eq_.lin.point_jacobian(held_, l.end, Vec3::Zero(), J);
      const Vec6 v = J * dz;
      const Vec3 arm = eq_.lin.frames.at(l.end).p - p;
      Vec6 d;
      d << dw.head<3>(), dw.tail<3>() + 0.5 * v.tail<3>().cross(w.tail<3>()) + (v.head<3>() - dp).cross(w.head<3>()) +
                             arm.cross(dw.head<3>());
      return d;
    };
    Vec6 first = change(clamp);
    std::size_t leg = 1;
    for (Index i = 0; i < clamp; ++i) {
      if (!held_.loops[at(i)].leg) continue;
      out.leg_stiffness[leg].col(k) = change(i);
      first -= out.leg_stiffness[leg++].col(k);
    }
    out.leg_stiffness.front().col(k) = first;
  }
  for (std::size_t i = 0; i < out.leg_stiffness.size(); ++i)
    if (!out.pose.leg_wrench.col(static_cast<Index>(i)).allFinite()) out.leg_stiffness[i].setConstant(nan);
}

/// What rigid parts carry between the clamp and the base is not a number.
void Clamp::hide_undetermined(ClampResult& out) {
  const MatX null = eq_.saddle.null_space();
  const Index n = held_.size(), clamp = held_.closures() - 6;
  for (Index c = 0; c < null.cols(); ++c)
    for (int k = 0; k < 6; ++k)
      if (std::abs(null(n + clamp + k, c)) > 1e-6) out.wrench[k] = nan;
  if (out.wrench.allFinite()) return;
  out.flags |= flag::internal_wrench_undetermined | flag::rigid_direction;
  out.pose.leg_wrench.setConstant(nan);
  out.leg_stiffness.assign(machine_.legs.size(), Mat6::Constant(nan));
}

void Clamp::solve(PoseInput in, const Vec6& displacement, ClampResult& out) {
  const auto fail = [&](Status status) {
    fail_pose(machine_, in, status, out.pose);
    out.status = status;
    out.wrench.setConstant(nan);
    out.leg_stiffness.assign(machine_.legs.size(), Mat6::Constant(nan));
  };
  const ClosureResult closure = prepare_pose(machine_, in, ws_);
  out.flags = out.pose.flags = closure.flags;
  out.pose.point.free = 0;
  out.pose.indeterminate.assign(at(machine_.size()), false);
  if (closure.status != Status::converged || !displacement.allFinite()) return fail(Status::unreachable);
  state_.z = ws_.state.z;
  state_.charts = ws_.state.charts;
  state_.lambda.setZero();
  if (!follow(displacement, ws_.problem)) return fail(Status::not_converged);

  // The same equilibrium, seen as the machine under the wrench of the clamp.
  out.wrench = loop_wrench(state_, static_cast<Index>(held_.loops.size()) - 1);
  in.load_points.push_back({point_.node, point_.offset, LoadType::dead});
  in.wrenches.push_back(out.wrench);
  ws_.problem.load_points = in.load_points;
  ws_.problem.wrenches = in.wrenches;
  ws_.problem.load_frames.push_back(ws_.nominal.at(point_.node).R);
  ws_.state.z = state_.z;
  ws_.state.charts = state_.charts;
  ws_.state.lambda = state_.lambda.head(machine_.closures());
  factorize_at(machine_, ws_.problem, ws_.state, ws_.equilibrium);
  EquilibriumResult free;
  free.falling = ws_.equilibrium.stability.falling(ws_.equilibrium.saddle);
  conclude_pose(machine_, in, free, ws_, out.pose);
  out.flags = out.pose.flags;
  out.status = eq_.stability.falling(eq_.saddle) == 0 ? Status::converged : Status::unstable;
  leg_stiffness(out);
  hide_undetermined(out);
}

}  // namespace stiffmap
