// SPDX-License-Identifier: MIT
#include "stiffmap/solve/solve.hpp"

#include <cmath>

#include "stiffmap/kinematics/pull.hpp"
#include "stiffmap/stiffness/stability.hpp"
#include "unloaded.hpp"

namespace stiffmap {
namespace {

using namespace unloaded;

/// The leg wrenches: multipliers of the outermost loops, and for the first leg what is left of all
/// that pushes on the platform (theory E3).
void leg_wrenches(const Mechanism& m, const PoseInput& in, const SolveWorkspace& ws, const Vec3& p, PoseResult& out) {
  const Frames& f = ws.equilibrium.lin.frames;
  out.leg_wrench.setZero(6, static_cast<Index>(m.legs.size()));
  if (m.legs.empty()) return;
  Vec6 left = Vec6::Zero();
  const auto add = [&](Vec6& w, const Vec3& force, const Vec3& moment, const Vec3& where, double sign) {
    w.head<3>() += sign * force;
    w.tail<3>() += sign * (moment + (where - p).cross(force));
  };
  for (std::size_t i = 0; i < in.load_points.size(); ++i) {
    const LoadPoint& l = in.load_points[i];
    if (!m.beyond_legs[at(l.node)]) continue;
    const Vec6 w = ws.problem.wrench_at(i, f.at(l.node).R);
    add(left, w.head<3>(), w.tail<3>(), f.point(l.node, l.offset), -1);
  }
  for (const NodeBody& b : m.bodies)
    if (m.beyond_legs[at(b.node)]) add(left, b.mass * in.gravity, Vec3::Zero(), f.point(b.node, b.com), -1);
  for (const NodeSpring& s : m.external_springs) {
    if (!m.beyond_legs[at(s.node)]) continue;
    Vec3 q;
    const Vec3 force = force_of(s, f, ws.equilibrium.lin.x, q);
    add(left, force, Vec3::Zero(), q, -1);
  }
  Index leg = 1;
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    if (!m.loops[i].leg) continue;
    const Vec6 w = ws.state.lambda.segment<6>(6 * static_cast<Index>(i));
    Vec6 on_platform = Vec6::Zero();
    add(on_platform, w.head<3>(), w.tail<3>(), f.at(m.loops[i].end).p, -1);
    out.leg_wrench.col(leg++) = on_platform;
    left -= on_platform;
  }
  out.leg_wrench.col(0) = left;
}

void reset(const Mechanism& m, std::uint32_t flags, PoseResult& out) {
  out.flags = flags;
  out.point.free = 0;
  out.indeterminate.assign(static_cast<std::size_t>(m.size()), false);
}

/// A free motion of passive coordinates at a pose: does it leave the stiffness as it is? Moves along
/// it, closes again, compares (theory K3).
bool configuration_undetermined(const Mechanism& m, const PoseInput& in, const VecX& motion, SolveWorkspace& ws,
                                const Mat6& stiffness) {
  VecX x = ws.x;
  Charts charts;
  keep_off_locks(m, x, charts);
  double size = 0;
  for (Index j = 0; j < m.size(); ++j)
    if (m.coordinates[at(j)].role == Role::passive) size = std::max(size, std::abs(motion[j]) * m.unit(j) / m.length);
  if (size < 1e-6) return false;
  constexpr double stride = 0.05;
  for (Index j = 0; j < m.size(); ++j)
    if (m.coordinates[at(j)].role == Role::passive) x[j] += stride / size * motion[j];
  x = by_own_axes(m, charts, x, ws.x);
  const VecX moved = x;
  if (close_passive(m, ws.reached, ws.closure, x) > 1e-9) return false;
  double kept = 0;
  for (Index j = 0; j < m.size(); ++j) kept = std::max(kept, std::abs(x[j] - ws.x[j]) * m.unit(j) / m.length);
  if (kept < 0.5 * stride) return false;  // came back: only an infinitesimal freedom
  const NodePoint& point = m.points[at(in.read_points.front())];
  return !(change(Unloaded(m).stiffness(x, point), stiffness) <= 1e-6);
}

/// Rank at the commanded configuration before any load: the four cases of theory (K3). True: go on.
bool examine_unloaded(const Mechanism& m, const PoseInput& in, SolveWorkspace& ws, PoseResult& out) {
  ws.problem.factor = 0;
  ws.problem.secant_laws = true;
  EquilibriumWorkspace& eq = ws.equilibrium;
  factorize_at(m, ws.problem, ws.state, eq);
  ws.problem.factor = 1;
  ws.problem.secant_laws = false;
  if (eq.saddle.regular()) return true;

  const NodePoint& point = m.points[at(in.read_points.front())];
  const StiffnessResult k = point_stiffness(m, eq.lin, eq.saddle, point.node, point.offset, ws.stiffness);
  const MatX null = eq.saddle.null_space();
  const Index n = m.size();
  Eigen::Matrix<double, 6, Eigen::Dynamic> J(6, n);
  eq.lin.point_jacobian(m, m.tip, Vec3::Zero(), J);
  for (Index c = 0; c < null.cols(); ++c) {
    VecX v = null.col(c);
    const double inside = v.head(n).norm();
    eq.saddle.to_coordinates(v);
    Vec6 tip = J * v.head(n);
    tip.tail<3>() *= m.length;
    double motion = 0;
    for (Index j = 0; j < n; ++j) motion = std::max(motion, std::abs(v[j]) * m.unit(j));
    if (inside < 1e-6) {
      out.flags |= flag::internal_wrench_undetermined;
    } else if (tip.norm() > 1e-5 * motion) {
      out.flags |= flag::platform_singular;
    } else {
      out.flags |= flag::leg_singular;
      for (Index j = 0; j < n; ++j)
        if (m.coordinates[at(j)].role == Role::passive && std::abs(v[j]) * m.unit(j) > 1e-3 * motion)
          out.indeterminate[at(j)] = true;
      if (configuration_undetermined(m, in, v.head(n), ws, k.stiffness)) out.flags |= flag::configuration_undetermined;
    }
  }
  if (k.free > 0) out.flags |= flag::platform_singular;
  if (!(out.flags & (flag::platform_singular | flag::configuration_undetermined))) return true;
  const std::uint32_t flags = out.flags;
  fail_pose(m, in, Status::singular, out);
  out.flags = flags;
  if (!(flags & flag::configuration_undetermined)) {
    out.point.stiffness = k.stiffness;
    out.point.free_twists = k.free_twists;
    out.point.free = k.free;
  }
  return false;
}

/// Compliance by the force-driven tangent: also where some motion of the point is impossible.
Mat6 compliance_of(const Mechanism& m, const NodePoint& p, EquilibriumWorkspace& eq) {
  MatX J(6, m.size());
  eq.lin.point_jacobian(m, p.node, p.offset, J);
  for (Index j = 0; j < m.size(); ++j) J.col(j) *= eq.lin.kind[at(j)] == Kind::fixed ? 0.0 : eq.lin.da[j];
  Mat6 C;
  for (int k = 0; k < 6; ++k) {
    eq.saddle.solve(J.row(k).transpose(), VecX::Zero(m.closures()), eq.dz, eq.dlambda);
    C.col(k) = J * eq.dz;
  }
  return C;
}

void report(const Mechanism& m, const PoseInput& in, const SolveWorkspace& ws, PoseResult& out) {
  const Linearization& lin = ws.equilibrium.lin;
  out.displacement.resize(in.read_points.size());
  for (std::size_t i = 0; i < in.read_points.size(); ++i) {
    const NodePoint& p = m.points[at(in.read_points[i])];
    const Pose &now = lin.frames.at(p.node), &then = p.node == m.tip ? ws.reached : ws.nominal.at(p.node);
    out.displacement[i] << now * p.offset - then * p.offset, log_so3(now.R * then.R.transpose());
  }
  out.effort.resize(static_cast<Index>(m.drives.size()));
  for (std::size_t i = 0; i < m.drives.size(); ++i) {
    const Index j = m.drives[i].coordinate;
    out.effort[static_cast<Index>(i)] = m.coordinates[at(j)].locked ? lin.r[j] : -lin.tau[j];
    if (std::abs(out.effort[static_cast<Index>(i)]) > m.drives[i].numbers.force_limit) out.flags |= flag::drive_force;
  }
  for (const Index i : m.cables)
    if (!(out.effort[m.coordinates[at(m.external_springs[at(i)].coordinate)].actuator] < 0)) out.flags |= flag::slack;
  const NodePoint& first = m.points[at(in.read_points.front())];
  leg_wrenches(m, in, ws, lin.frames.point(first.node, first.offset), out);
  out.x = by_own_axes(m, ws.state.charts, lin.x, ws.x);
  for (Index j = 0; j < m.size(); ++j)
    if (m.coordinates[at(j)].locked && m.coordinates[at(j)].role == Role::passive && !ws.spins.decided(j)) {
      out.flags |= flag::free_spin;
      out.indeterminate[at(j)] = true;
    }
}

/// Internal wrenches that the machine leaves open are not numbers.
void hide_undetermined(const Mechanism& m, const SolveWorkspace& ws, PoseResult& out) {
  if (ws.equilibrium.saddle.regular()) return;
  const MatX null = ws.equilibrium.saddle.null_space();
  for (Index c = 0; c < null.cols(); ++c) {
    if (null.col(c).head(m.size()).norm() > 1e-6) continue;
    out.flags |= flag::internal_wrench_undetermined;
    Index leg = 1;
    for (std::size_t i = 0; i < m.loops.size(); ++i) {
      if (!m.loops[i].leg) continue;
      if (null.col(c).segment<6>(m.size() + 6 * static_cast<Index>(i)).norm() > 1e-6) {
        out.leg_wrench.col(leg).setConstant(nan);
        out.leg_wrench.col(0).setConstant(nan);
      }
      ++leg;
    }
  }
}

/// Cables that leave a motion of the platform free: no compliance, also where guides hold other directions.
void let_float(const Mechanism& m, const NodePoint& p, SolveWorkspace& ws, PoseResult& out) {
  out.flags |= flag::platform_singular;
  if (out.status == Status::converged) out.status = Status::singular;
  out.point.compliance.setConstant(nan);
  out.point.free_twists.setConstant(nan);
  const MatX null = ws.equilibrium.saddle.null_space();
  MatX J(6, m.size());
  ws.equilibrium.lin.point_jacobian(m, p.node, p.offset, J);
  out.point.free = 0;
  for (Index c = 0; c < null.cols() && out.point.free < 6; ++c) {
    VecX v = null.col(c);
    ws.equilibrium.saddle.to_coordinates(v);
    const Vec6 twist = J * v.head(m.size());
    out.point.free_twists.col(out.point.free++) = twist / twist.norm();
  }
}

}  // namespace

SolveWorkspace::SolveWorkspace(const Mechanism& m)
    : closure(m), equilibrium(m), stiffness(m), spins(m), problem(m), state(m), nominal(m), x(VecX::Zero(m.size())) {}

ClosureResult prepare_pose(const Mechanism& m, const PoseInput& in, SolveWorkspace& ws) {
  if (in.closed) ws.x = Eigen::Map<const VecX>(in.closed, m.size());
  ClosureResult closure =
      in.closed ? given_closure(m, ws.closure, ws.x) : inverse_closure(m, in.commanded, ws.closure, ws.x);
  if (closure.status != Status::converged) return closure;
  ws.reached = m.task == full_task && closure.exact ? in.commanded : closure.tip;
  forward(m, Geometry::nominal, ws.x, ws.nominal);
  ws.problem.misfit.setZero();
  if (!closure.exact)
    for (std::size_t i = 0; i < m.loops.size(); ++i)
      ws.problem.misfit.segment<6>(6 * static_cast<Index>(i)) =
          frame_error(ws.nominal.at(m.loops[i].primary), ws.nominal.at(m.loops[i].end));
  ws.problem.gravity = in.gravity;
  if (!command(m, ws.x, ws.problem)) {
    closure.status = Status::unreachable;  // a ram that is not there
    return closure;
  }
  start_state(m, ws.x, ws.state);
  ws.problem.load_points = in.load_points;
  ws.problem.wrenches = in.wrenches;
  ws.problem.load_frames.clear();
  for (const LoadPoint& l : in.load_points) ws.problem.load_frames.push_back(ws.nominal.at(l.node).R);
  return closure;
}

void solve_pose(const Mechanism& m, const PoseInput& in, const SolveOptions& options, SolveWorkspace& ws,
                PoseResult& out) {
  out.iterations = 0;
  ws.spins.hold();
  const ClosureResult closure = prepare_pose(m, in, ws);
  reset(m, closure.flags, out);
  if (closure.status != Status::converged) return fail_pose(m, in, Status::unreachable, out);
  if (!m.floating && !examine_unloaded(m, in, ws, out)) return;  // what floats is carried by what acts on it

  EquilibriumResult eq = solve_equilibrium(m, ws.problem, options.equilibrium, ws.equilibrium, ws.state);
  if (eq.status == Status::converged && ws.spins.loaded(ws.problem) &&
      !ws.spins.settle(ws.problem, options.equilibrium, ws.equilibrium, ws.state, eq))
    eq.status = Status::not_converged;
  out.iterations = eq.iterations;
  out.flags |= eq.flags;
  if (eq.status != Status::converged) return fail_pose(m, in, eq.status, out);
  conclude_pose(m, in, eq, ws, out);
}

void fail_pose(const Mechanism& m, const PoseInput& in, Status status, PoseResult& out) {
  out.status = status;
  out.displacement.assign(in.read_points.size(), Vec6::Constant(nan));
  out.point.stiffness.setConstant(nan);
  out.point.compliance.setConstant(nan);
  out.point.free_twists.setConstant(nan);
  out.effort.setConstant(static_cast<Index>(m.drives.size()), nan);
  out.leg_wrench.setConstant(6, static_cast<Index>(m.legs.size()), nan);
  out.x.setConstant(m.size(), nan);
}

void conclude_pose(const Mechanism& m, const PoseInput& in, const EquilibriumResult& eq, SolveWorkspace& ws,
                   PoseResult& out) {
  out.status = Status::converged;
  report(m, in, ws, out);

  const NodePoint& p = m.points[at(in.read_points.front())];
  const EquilibriumWorkspace& done = ws.equilibrium;
  out.point = point_stiffness(m, done.lin, done.saddle, p.node, p.offset, ws.stiffness);
  if (done.saddle.regular() || out.point.flags & flag::rigid_direction)
    by_compliance(m, compliance_of(m, p, ws.equilibrium), done.saddle.regular(), out.point);
  ws.spins.release(p, ws.equilibrium, out.point);
  out.flags |= out.point.flags;
  const bool nonconservative = ws.problem.is_nonconservative();
  if (nonconservative) out.flags |= flag::nonconservative;
  // No falling direction is enough under any load; a moment may leave some without harm.
  if (eq.falling > 0 && (!nonconservative || eq.sign_changes > 0 || grows(m, done.lin))) out.status = Status::unstable;
  if (out.point.free > 0 && out.status == Status::converged) {
    out.status = Status::singular;
    bool gap = false;
    for (Index j = 0; j < m.size(); ++j)
      gap = gap || (m.coordinates[at(j)].law >= 0 && done.lin.kind[at(j)] == Kind::free);
    out.flags |= gap ? flag::free_play | flag::platform_singular : flag::platform_singular;
  }
  if (m.floating && !done.saddle.regular()) let_float(m, p, ws, out);
  hide_undetermined(m, ws, out);
}

}  // namespace stiffmap
