// SPDX-License-Identifier: MIT
#include "stiffmap/closure/closure.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "closing.hpp"
#include "stiffmap/kinematics/pull.hpp"

namespace stiffmap {
namespace closing {
namespace {

constexpr double stationary = 1e-9;     // a step that leaves what misfit there is
constexpr double contraction = 0.25;    // Newton steps of a trusted continuation shrink at least so
constexpr double shortest_leap = 1e-3;  // of the way from home
constexpr double quick_leap = 0.01;     // the same of one attempt of several

}  // namespace

void select_unknowns(const Mechanism& m, bool actuators, ClosureWorkspace& ws) {
  ws.redundant = actuators && m.redundancy > 0;
  ws.unknown.clear();
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.role == Role::spring || c.cable >= 0) continue;
    if (c.role == Role::actuator ? actuators : !c.locked) ws.unknown.push_back(j);
  }
}

double residual(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws) {
  forward(m, Geometry::nominal, x, ws.frames, &ws.charts);
  ws.e.setZero();
  if (target.tip) {
    ws.e.head<6>() = -frame_error(ws.frames.at(m.tip), *target.tip);
    target.mask(ws.e.head<6>());
  }
  for (std::size_t i = 0; i < m.loops.size(); ++i)
    ws.e.segment<6>(6 + 6 * static_cast<Index>(i)) =
        frame_error(ws.frames.at(m.loops[i].primary), ws.frames.at(m.loops[i].end));
  const Index loops = 6 + m.closures();
  for (Index i = 0; i < loops; ++i)
    if (i % 6 >= 3) ws.e[i] *= m.length;
  for (Index i = 0; i < winches(m, target); ++i) {
    const NodeSpring& s = m.external_springs[at(m.cables[at(i)])];
    const Vec3 p = ws.frames.point(s.node, s.offset);
    const double length = cable_line(s.anchor, s.winch->axis, s.winch->radius, p).length;
    ws.e[loops + i] = commanded_length(s, length) - x[s.coordinate];
  }
  return ws.e.cwiseAbs().maxCoeff() / m.length;
}

void equations(const Mechanism& m, const Target& target, ClosureWorkspace& ws) {
  ws.J.setZero();
  if (target.tip) {
    add_jacobian(m, ws.frames, m.tip, ws.frames.at(m.tip).p, 1.0, ws.J.topRows<6>());
    target.mask(ws.J.topRows<6>());
  }
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    const Index row = 6 + 6 * static_cast<Index>(i);
    const Loop& loop = m.loops[i];
    add_jacobian(m, ws.frames, loop.end, ws.frames.at(loop.end).p, 1.0, ws.J.middleRows<6>(row));
    add_jacobian(m, ws.frames, loop.primary, ws.frames.at(loop.primary).p, -1.0, ws.J.middleRows<6>(row));
  }
  const Index loops = 6 + m.closures();
  for (Index i = 0; i < winches(m, target); ++i) {
    const NodeSpring& s = m.external_springs[at(m.cables[at(i)])];
    const Vec3 p = ws.frames.point(s.node, s.offset);
    const Vec3 along = commanded_slope(s) * cable_line(s.anchor, s.winch->axis, s.winch->radius, p).along;
    for (Index j : m.path[at(s.node)]) ws.J(loops + i, j) += along.dot(column(m, ws.frames, j, p).head<3>());
  }
  const Index n = static_cast<Index>(ws.unknown.size());
  ws.A.resize(ws.J.rows(), n);
  for (Index k = 0; k < n; ++k) {
    const Index j = ws.unknown[at(k)];
    ws.A.col(k) = ws.J.col(j) / m.unit(j);
  }
  for (Index i = 0; i < loops; ++i)
    if (i % 6 >= 3) ws.A.row(i) *= m.length;
}

double newton_step(const Mechanism& m, const Target& target, ClosureWorkspace& ws) {
  const Index n = static_cast<Index>(ws.unknown.size());
  equations(m, target, ws);
  if (n == 0) return 0;  // no joint at all: a structure
  ws.qr.compute(ws.A, rank_threshold);
  ws.right = -ws.e;
  ws.qr.solve(ws.right, ws.shortest);
  ws.step.head(n) = ws.shortest;
  const double norm = ws.step.head(n).norm() / m.length;
  for (Index k = 0; k < n; ++k) ws.step[k] /= m.unit(ws.unknown[at(k)]);
  return norm;
}

static void apply(ClosureWorkspace& ws, VecX& x, double factor) {
  for (std::size_t k = 0; k < ws.unknown.size(); ++k) x[ws.unknown[k]] += factor * ws.step[static_cast<Index>(k)];
}

std::uint32_t limits_met(const Mechanism& m, const VecX& x) {
  std::uint32_t flags = 0;
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (x[j] >= c.lower && x[j] <= c.upper) continue;
    flags |= c.role == Role::actuator ? flag::drive_range : flag::joint_limit;
  }
  for (const Ball& b : m.balls)
    if (!b.free && b.spread(x[b.first + 1]) < near_lock) flags |= flag::gimbal_lock;
  return flags;
}

bool close(const Mechanism& m, const Target& target, Pace pace, ClosureWorkspace& ws, VecX& x, int& iterations) {
  const int most = pace == Pace::contracting ? 12 : 120;
  double previous = 0, error = residual(m, x, target, ws);
  const bool nearest = ws.redundant && target.tip;
  if (nearest && std::isfinite(error)) estimate_multipliers(m, x, target, ws);
  for (int k = 0; k < most; ++k) {
    if (!std::isfinite(error)) return false;
    ++iterations;
    const double norm = nearest ? nearest_step(m, x, target, ws) : newton_step(m, target, ws);
    if (pace == Pace::contracting && norm > 0.3) return false;
    if (pace == Pace::contracting && k > 0 && norm > contraction * previous && norm > 1e-9) return false;
    apply(ws, x, norm > 0.1 ? 0.1 / norm : 1.0);
    if (ws.renumber && pace == Pace::damped) keep_off_locks(m, x, ws.charts);
    previous = norm;
    const double before = error;
    error = residual(m, x, target, ws);
    if (error < round_off && norm < 1e-7) return true;
    if (norm < stationary && error > 0.5 * before) return error < input_tolerance;
  }
  return error < round_off;
}

}  // namespace closing

namespace {

using namespace closing;

/// Interpolates between home and the pose.
Pose on_the_way(const Pose& a, const Pose& b, double s) {
  if (s == 1) return b;
  return {a.p + s * (b.p - a.p), exp_so3(s * log_so3(b.R * a.R.transpose())) * a.R};
}

/// Adaptive continuation: `set(s)` puts the target to the share s of the way. `patient`: where its steps shrink without
/// end, one attempt from there, of which configuration it may be.
template <class Set>
bool continuation(const Mechanism& m, const Target& target, Set&& set, ClosureWorkspace& ws, VecX& x,
                  ClosureResult& out, bool patient = true) {
  double done = 0, leap = 1;
  while (done < 1) {
    const double s = std::min(1.0, done + leap);
    ws.trial = x;
    set(s, ws.trial);
    if (close(m, target, Pace::contracting, ws, ws.trial, out.iterations)) {
      x = ws.trial;
      if (ws.renumber) keep_off_locks(m, x, ws.charts);
      done = s;
      leap *= 2;
      continue;
    }
    leap *= 0.5;
    if (leap >= (patient ? shortest_leap : quick_leap)) continue;
    if (!patient) return false;
    ws.trial = x;  // at a border of the workspace
    set(1.0, ws.trial);
    if (close(m, target, Pace::damped, ws, ws.trial, out.iterations)) {
      x = ws.trial;
      if (1 - done > 0.05) out.flags |= flag::branch_unverified;
      return true;
    }
    return false;
  }
  return true;
}

/// From closed coordinates `x`, at which the tip has the pose `from`, straight to another pose.
bool straight_on(const Mechanism& m, const Pose& from, const Pose& pose, ClosureWorkspace& ws, VecX& x,
                 ClosureResult& out, bool patient = true) {
  Pose way;
  const auto set = [&](double s, VecX&) { way = on_the_way(from, pose, s); };
  return continuation(m, Target{&way, m.task}, set, ws, x, out, patient);
}

/// A search starts at `x`, by its own axes; for good where the nearest configuration is sought, which counts by them.
void start(const Mechanism& m, ClosureWorkspace& ws, VecX& x) {
  ws.charts = {};
  ws.renumber = m.redundancy == 0;
  if (ws.renumber) keep_off_locks(m, x, ws.charts);
}

/// It ends there.
void stop(const Mechanism& m, ClosureWorkspace& ws, VecX& x) {
  if (!ws.charts.plain()) x = by_own_axes(m, ws.charts, x, m.home_coordinates);
  ws.charts = {};
  ws.renumber = false;
}

/// Home with the first drive turned so that the tip is where the pose is about its axis; all that follows turns with
/// it. False where there is no such drive.
bool turn_home(const Mechanism& m, const Pose& pose, ClosureWorkspace& ws, VecX& x) {
  const auto has = [&](Index node, Index j) {
    const auto& path = m.path[at(node)];
    return std::find(path.begin(), path.end(), j) != path.end();
  };
  const auto& path = m.path[at(m.tip)];
  const auto springs = [&](Index j) { return m.coordinates[at(j)].role == Role::spring; };
  const auto first = std::find_if_not(path.begin(), path.end(), springs);
  if (!m.cables.empty() || first == path.end() || m.coordinates[at(*first)].role != Role::actuator) return false;
  const Index j = *first;
  for (const Loop& l : m.loops)
    if (has(l.primary, j) != has(l.end, j)) return false;
  x = m.home_coordinates;
  forward(m, Geometry::nominal, x, ws.frames);
  const Vec6 tip = column(m, ws.frames, j, ws.frames.at(m.tip).p);
  const Vec3 axis = tip.tail<3>(), from = tip.head<3>(), to = column(m, ws.frames, j, pose.p).head<3>();
  if (axis.isZero(0) || std::min(from.norm(), to.norm()) < rank_threshold * m.length) return false;
  const Coordinate& c = m.coordinates[at(j)];
  x[j] += std::atan2(axis.dot(from.cross(to)), from.dot(to));
  if (x[j] > c.upper) x[j] -= 2 * std::numbers::pi;
  if (x[j] < c.lower) x[j] += 2 * std::numbers::pi;
  start(m, ws, x);
  forward(m, Geometry::nominal, x, ws.frames, &ws.charts);
  return true;
}

/// From anywhere, in as many steps as it takes: of which configuration the end is then is not known.
bool all_at_once(const Mechanism& m, const Target& target, const VecX& from, ClosureWorkspace& ws, VecX& x,
                 ClosureResult& out) {
  x = from;
  start(m, ws, x);
  const bool ok = close(m, target, Pace::damped, ws, x, out.iterations);
  if (ok) out.flags |= flag::branch_unverified;
  return ok;
}

void finish(const Mechanism& m, const Target& target, bool ok, ClosureWorkspace& ws, VecX& x, ClosureResult& out) {
  if (ok && ws.redundant && target.tip && !is_nearest(m, x, target, ws)) out.flags |= flag::branch_unverified;
  const double error = residual(m, x, target, ws);
  stop(m, ws, x);
  out.residual = error * m.length;
  out.exact = error < round_off;
  out.tip = ws.frames.at(m.tip);
  out.status = ok ? Status::converged : Status::unreachable;
  if (ok) out.flags |= limits_met(m, x);
}

}  // namespace

ClosureWorkspace::ClosureWorkspace(const Mechanism& m)
    : frames(m),
      J(MatX::Zero(6 + m.closures() + static_cast<Index>(m.cables.size()), m.size())),
      A(J),
      e(VecX::Zero(J.rows())),
      step(VecX::Zero(m.size())),
      x(VecX::Zero(m.size())),
      trial(VecX::Zero(m.size())),
      start(VecX::Zero(m.size())),
      wanted(m.home_coordinates) {}

ClosureResult inverse_closure(const Mechanism& m, const Pose& pose, ClosureWorkspace& ws, VecX& x) {
  const ClosureResult straight = inverse_closure(m, pose, ws, x, m.home_coordinates, m.home);
  const bool sure = straight.status == Status::converged && !(straight.flags & flag::branch_unverified);
  if (sure || !pose.p.allFinite() || !pose.R.allFinite()) return straight;
  // The straight way may lead through the axis of the first drive.
  const VecX found = x;
  ClosureResult out;
  if (turn_home(m, pose, ws, x)) {
    const Pose there = ws.frames.at(m.tip);
    const bool ok = straight_on(m, there, pose, ws, x, out, false);
    finish(m, Target{&pose, m.task}, ok, ws, x, out);
  }
  if (out.status == Status::converged) return out;
  x = found;
  return straight;
}

ClosureResult inverse_closure(const Mechanism& m, const Pose& pose, ClosureWorkspace& ws, VecX& x, const VecX& from,
                              const Pose& at_pose) {
  ClosureResult out;
  if (!pose.p.allFinite() || !pose.R.allFinite()) return out;
  select_unknowns(m, true, ws);
  ws.wanted = m.home_coordinates;
  x = from;
  start(m, ws, x);
  const Target target{&pose, m.task};
  bool ok = straight_on(m, at_pose, pose, ws, x, out);
  if (!ok && m.beside_home.size() > 0) {  // from home no way leads where a locked hinge has to turn by a right angle
    x = m.beside_home;
    start(m, ws, x);
    forward(m, Geometry::nominal, x, ws.frames, &ws.charts);
    const Pose beside = ws.frames.at(m.tip);
    ok = straight_on(m, beside, pose, ws, x, out);
    if (ok) out.flags |= flag::branch_unverified;
  }
  // The straight way may leave the workspace although its end lies inside.
  ok = ok || all_at_once(m, target, m.home_coordinates, ws, x, out);
  if (!m.cables.empty()) {  // where all else is closed
    forward(m, Geometry::nominal, x, ws.frames, &ws.charts);
    wind(m, ws.frames, x);
  }
  finish(m, target, ok, ws, x, out);
  return out;
}

namespace {

/// Joint coordinates of `given`, springs and spins as at home.
VecX joints_only(const Mechanism& m, const VecX& given) {
  VecX x = m.home_coordinates;
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.role == Role::actuator || (c.role == Role::passive && !c.locked)) x[j] = given[j];
  }
  return x;
}

/// More drives than freedoms: commands may agree although those on the way to them contradict each other. Looked for to
/// both sides of the nearest closure, where it yields most (theory C9).
bool across_fold(const Mechanism& m, ClosureWorkspace& ws, VecX& x, int& iterations) {
  select_unknowns(m, true, ws);
  residual(m, m.home_coordinates, Target{}, ws);
  equations(m, Target{}, ws);
  ws.qr.compute(ws.A, rank_threshold);
  select_unknowns(m, false, ws);  // A and its rank are still those with the drives
  if (ws.unknown.empty() || static_cast<Index>(m.drives.size()) <= ws.A.cols() - ws.qr.rank()) return false;
  close(m, Target{}, Pace::damped, ws, x, iterations);
  const VecX nearest = x;
  equations(m, Target{}, ws);
  const VecX softest = symmetric_eigen(MatX(ws.A.transpose() * ws.A)).vectors.col(0);
  for (double away = 0.01; std::abs(away) < 1; away *= -1.25) {
    x = nearest;
    for (std::size_t k = 0; k < ws.unknown.size(); ++k)
      x[ws.unknown[k]] += away * m.length / m.unit(ws.unknown[k]) * softest[static_cast<Index>(k)];
    if (close(m, Target{}, Pace::damped, ws, x, iterations)) return true;
  }
  x = nearest;
  return false;
}

/// From closed coordinates `x` to given actuators.
ClosureResult follow_actuators(const Mechanism& m, const VecX& actuators, ClosureWorkspace& ws, VecX& x) {
  ClosureResult out;
  select_unknowns(m, false, ws);
  start(m, ws, x);
  const VecX from = x;
  const auto set = [&](double s, VecX& trial) {
    for (std::size_t i = 0; i < m.drives.size(); ++i) {
      const Index j = m.drives[i].coordinate;
      trial[j] = from[j] + s * (actuators[static_cast<Index>(i)] - from[j]);
    }
  };
  const bool closed = ws.unknown.empty() && m.loops.empty() && m.cables.empty();  // an arm: wherever its drives stand
  if (closed) set(1.0, x);
  bool ok = closed || continuation(m, Target{}, set, ws, x, out);
  if (!ok) {
    set(1.0, x);
    ok = across_fold(m, ws, x, out.iterations);
    if (ok) out.flags |= flag::branch_unverified;
  }
  finish(m, Target{}, ok, ws, x, out);
  return out;
}

}  // namespace

ClosureResult forward_closure(const Mechanism& m, const VecX& actuators, ClosureWorkspace& ws, VecX& x) {
  if (!actuators.allFinite()) return {};
  x = m.home_coordinates;
  return follow_actuators(m, actuators, ws, x);
}

ClosureResult forward_closure(const Mechanism& m, const VecX& actuators, ClosureWorkspace& ws, VecX& x,
                              const VecX& from) {
  if (!actuators.allFinite() || !from.allFinite()) return {};
  x = joints_only(m, from);
  select_unknowns(m, false, ws);
  start(m, ws, x);
  int iterations = 0;
  const bool ok = close(m, Target{}, Pace::damped, ws, x, iterations);
  stop(m, ws, x);
  return ok ? follow_actuators(m, actuators, ws, x) : ClosureResult{};
}

ClosureResult branch_closure(const Mechanism& m, const Pose& pose, ClosureWorkspace& ws, VecX& x, const VecX& from) {
  ClosureResult out;
  if (!pose.p.allFinite() || !pose.R.allFinite() || !from.allFinite()) return out;
  x = ws.wanted = joints_only(m, from);
  start(m, ws, x);
  select_unknowns(m, false, ws);
  const Target target{&pose, m.task};
  bool ok = close(m, Target{}, Pace::damped, ws, x, out.iterations);
  select_unknowns(m, true, ws);
  if (ok) {
    const Pose first = ws.frames.at(m.tip);
    ok = straight_on(m, first, pose, ws, x, out);
  }
  // Actuators and the others may belong to different configurations: all move at once.
  ok = ok || all_at_once(m, target, ws.wanted, ws, x, out);
  finish(m, target, ok, ws, x, out);
  return out;
}

ClosureResult given_closure(const Mechanism& m, ClosureWorkspace& ws, const VecX& x) {
  ClosureResult out;
  if (!x.allFinite()) return out;
  VecX same = x;
  finish(m, Target{}, true, ws, same, out);
  return out;
}

double close_passive(const Mechanism& m, const Pose& tip, ClosureWorkspace& ws, VecX& x) {
  select_unknowns(m, false, ws);
  const Target target{&tip};
  int iterations = 0;
  start(m, ws, x);
  close(m, target, Pace::damped, ws, x, iterations);
  const double error = residual(m, x, target, ws);
  stop(m, ws, x);
  return error;
}

}  // namespace stiffmap
