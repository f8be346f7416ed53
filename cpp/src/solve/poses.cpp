// SPDX-License-Identifier: MIT
#include "stiffmap/solve/poses.hpp"

#include <cmath>

#include "stiffmap/closure/pose_closer.hpp"
#include "stiffmap/common/parallel.hpp"
#include "stiffmap/kinematics/enclosure.hpp"
#include "stiffmap/solve/clamp.hpp"

namespace stiffmap {
namespace {

Mat3 rotation_of(const Rows& R, Index i) { return Eigen::Map<const Row3>(R.data() + 9 * i); }

Pose pose_of(const Rows& p, const Rows& R, Index i) { return {p.row(i).transpose(), rotation_of(R, i)}; }

/// Row i, or NaN where there are no rows.
void start_at(const Rows& start, Index i, VecX& x) {
  if (start.rows()) x = start.row(i).transpose();
  else x.setConstant(nan);
}

void check_poses(const Rows& position, const Rows& rotation) {
  check_rows(position, "position", position.rows(), 3);
  check_rows(rotation, "rotation", position.rows(), 9);
}

void check_drives(const Mechanism& m, const VecX& weights) {
  const Index drives = static_cast<Index>(m.drives.size());
  require(weights.size() == 0 || weights.size() == drives, "weights", "one per drive, or none", weights.size());
}

void check_bodies(const Mechanism& m, const Inertias& inertias) {
  require(inertias.size() == m.bodies.size(), "inertias", "one per body", inertias.size());
}

/// Pose i, loaded and read at a point.
PoseInput loaded(const Mechanism& m, const Rows& position, const Rows& rotation, const Rows& wrench,
                 const Vec3& gravity, Index point, Index i) {
  PoseInput in;
  in.commanded = pose_of(position, rotation, i);
  in.gravity = gravity;
  in.load_points = {load_at(m, point)};
  in.wrenches = {Vec6(wrench.row(i).transpose())};
  in.read_points = {point};
  return in;
}

}  // namespace

Answers closures(const Mechanism& m, const FastPlan* plan, const Rows& given, const Rows& rotation, const Rows& start,
                 int threads) {
  const bool inverse = rotation.rows() > 0, started = start.rows() > 0;
  if (inverse) check_poses(given, rotation);
  else check_rows(given, "actuators", given.rows(), static_cast<Index>(m.drives.size()));
  check_rows(start, "start", given.rows(), m.size(), true);
  Answers out(given.rows());
  const Blocks coordinates = out.numbers("coordinates", {m.size()}), position = out.numbers("position", {3}),
               turned = out.numbers("rotation", {3, 3});
  Status* const status = out.each("status", Status::unreachable);
  std::uint32_t* const flags = out.each("flags", 0u);
  parallel_chunks(given.rows(), 64, threads, [&](int, long begin, long end) {
    ClosureWorkspace ws(m);
    PoseCloser closer(m);
    VecX x = VecX::Zero(m.size()), from = x;
    for (long i = begin; i < end; ++i) {
      ClosureResult r;
      if (started) from = start.row(i).transpose();
      if (!inverse) {
        const VecX a = given.row(i).transpose();
        r = started ? forward_closure(m, a, ws, x, from) : forward_closure(m, a, ws, x);
      } else {
        const Pose pose = pose_of(given, rotation, i);
        if (started) {
          r = branch_closure(m, pose, ws, x, from);
        } else if (m.redundancy == 0) {  // else it is asked whether the nearest configuration was found
          if (!plan || !plan->nearest_start(m, pose.p, x)) x = m.home_coordinates;
          r = closer.continue_from(m, pose, x);
        }
        if (!started && (r.status != Status::converged || r.flags & flag::branch_unverified))
          r = inverse_closure(m, pose, ws, x);
      }
      status[i] = r.status;
      flags[i] = r.flags;
      if (r.status != Status::converged) continue;
      coordinates(i) = x;
      position(i) = r.tip.p;
      turned(i) = r.tip.R;
    }
  });
  return out;
}

Answers kinematics(const Mechanism& m, const Rows& position, const Rows& rotation, const Rows& start,
                   const VecX& weights, bool patient, bool only, int threads) {
  const Index n = position.rows(), size = m.size(), drives = static_cast<Index>(m.drives.size());
  check_poses(position, rotation);
  check_rows(start, "start", n, size, true);
  check_drives(m, weights);
  Answers out(n);
  const Blocks coordinates = out.numbers("coordinates", {size}), tip = out.numbers("position", {3}),
               turned = out.numbers("rotation", {3, 3}), jacobian = out.numbers("jacobian", {6, drives}),
               free = out.numbers("free_twist", {6}), pivot = out.numbers("pivot", {}),
               sharing = out.numbers("sharing", {drives, drives});
  std::int32_t* const together = out.each("together", static_cast<std::int32_t>(drives));
  Status* const status = out.each("status", Status::unreachable);
  std::uint32_t* const flags = out.each("flags", 0u);
  parallel_chunks(n, 64, threads, [&](int, long begin, long end) {
    PoseCloser closer(m);
    LoopRates loops(m);
    Motion motion;
    VecX x(size);
    for (long i = begin; i < end; ++i) {
      start_at(start, i, x);
      const Pose pose = pose_of(position, rotation, i);
      const ClosureResult r = only ? closer.continue_from(m, pose, x) : closer.close(m, pose, x, patient);
      status[i] = r.status;
      flags[i] = r.flags;
      if (r.status != Status::converged) continue;
      loops.factorise(m, closer.frames());
      loops.motion(m, closer.frames(), motion, weights);
      coordinates(i) = x;
      tip(i) = r.tip.p;
      turned(i) = r.tip.R;
      pivot(i).setConstant(motion.pivot);
      sharing(i) = motion.sharing;
      together[i] = static_cast<std::int32_t>(motion.together);
      free(i) = motion.free_twist;
      if (!motion.free_twist.hasNaN()) {
        status[i] = Status::singular;
        flags[i] |= flag::platform_singular;
        continue;
      }
      jacobian(i) = motion.J;
    }
  });
  return out;
}

Answers enclosures(const Mechanism& m, const Rows& centre, const Rows& half, const Mat3& axes, const Mat3& rotation,
                   const Rows& start, Index slopes, const std::vector<Index>& watched, int threads) {
  const Index n = centre.rows(), size = m.size(), nodes = static_cast<Index>(watched.size());
  check_rows(centre, "centre", n, 3);
  check_rows(half, "half", n, 3);
  check_rows(start, "start", n, size, true);
  Answers out(n);
  std::uint8_t *const closed = out.each<std::uint8_t>("closed", 0), *const enclosed =
                                                                        out.each<std::uint8_t>("enclosed", 0);
  const Blocks coordinates = out.numbers("coordinates", {size}), slope = out.numbers("slope", {size, slopes}),
               radius = out.numbers("radius", {size}), change = out.numbers("change", {3, size, slopes}),
               slack = out.numbers("slack", {size, slopes}), points = out.numbers("points", {nodes, 3}),
               moved = out.numbers("moved", {nodes}), bend = out.numbers("bend", {3});
  parallel_chunks(n, 16, threads, [&](int, long begin, long end) {
    PoseCloser closer(m);
    Encloser encloser(m);
    Enclosure e;
    VecX x(size);
    for (long i = begin; i < end; ++i) {
      start_at(start, i, x);
      const ClosureResult r = closer.close(m, {centre.row(i).transpose(), rotation}, x, false);
      closed[i] = r.status == Status::converged;
      if (!closed[i]) continue;
      coordinates(i) = x;
      encloser.enclose(m, closer.frames(), x, axes, half.row(i).transpose(), slopes, watched, e);
      for (Index k = 0; k < nodes; ++k) points(i).row(k) = closer.frames().at(watched[at(k)]).p.transpose();
      bend(i) = e.bend;
      enclosed[i] = e.enclosed;
      if (!e.enclosed) continue;
      slope(i) = e.G;
      slack(i) = e.slack;
      radius(i) = e.radius;
      moved(i) = e.moved;
      for (Index k = 0; k < 3; ++k) change(i).middleRows(size * k, size) = e.change[at(k)];
    }
  });
  return out;
}

Answers dynamics(const Mechanism& m, const Inertias& inertias, const Rows& coordinates, const Rows& twist,
                 const Rows& twist_rate, const Rows& wrench, const Vec3& gravity, const Rows& rates,
                 const Rows& accelerations, const VecX& weights, int threads) {
  const Index n = coordinates.rows(), drives = static_cast<Index>(m.drives.size());
  check_rows(coordinates, "coordinates", n, m.size());
  check_rows(twist, "twist", n, 6);
  check_rows(twist_rate, "twist_rate", n, 6);
  check_rows(wrench, "wrench", n, 6);
  check_rows(rates, "rates", n, drives, true);
  check_rows(accelerations, "accelerations", rates.rows(), drives);
  check_drives(m, weights);
  check_bodies(m, inertias);
  Answers out(n);
  const Blocks effort = out.numbers("effort", {drives}), rate = out.numbers("rate", {drives}),
               acceleration = out.numbers("acceleration", {drives}), mass = out.numbers("mass", {drives, drives}),
               kinetic = out.numbers("kinetic", {}), potential = out.numbers("potential", {}),
               misfit = out.numbers("misfit", {});
  parallel_chunks(n, 64, threads, [&](int, long begin, long end) {
    Frames frames(m);
    LoopRates loops(m);
    Motion motion;
    DynamicsResult r;
    for (long i = begin; i < end; ++i) {
      const VecX x = coordinates.row(i).transpose();
      if (!x.allFinite()) continue;
      forward(m, Geometry::nominal, x, frames);
      loops.factorise(m, frames);
      loops.motion(m, frames, motion, weights);
      if (!motion.free_twist.hasNaN()) continue;
      DynamicsInput in{
          twist.row(i).transpose(), twist_rate.row(i).transpose(), wrench.row(i).transpose(), gravity, {}, {}};
      if (rates.rows()) {
        in.rate = rates.row(i).transpose();
        in.acceleration = accelerations.row(i).transpose();
      }
      drive_dynamics(m, inertias, x, frames, loops, motion, in, r);
      effort(i) = r.effort;
      rate(i) = r.rate;
      acceleration(i) = r.acceleration;
      mass(i) = r.mass;
      kinetic(i).setConstant(r.kinetic);
      potential(i).setConstant(r.potential);
      misfit(i).setConstant(r.misfit);
    }
  });
  return out;
}

Answers modes(const Mechanism& m, const Inertias& inertias, const VecX& viscous, const VecX& loss, const Rows& position,
              const Rows& rotation, const Rows& wrench, const Vec3& gravity, const Rows& closed,
              const std::string& point, Index count, bool whole, int threads) {
  const Index n = position.rows(), read = m.point(point);
  check_poses(position, rotation);
  check_rows(wrench, "wrench", n, 6);
  check_rows(closed, "closed", n, m.size(), true);
  check_bodies(m, inertias);
  const Damping damping{viscous, loss};
  for (const VecX* each : {&viscous, &loss})
    require(each->size() == m.size(), "damping", "one number per coordinate", each->size());
  Answers out(n);
  const Blocks square = out.numbers("square", {count}), tip = out.numbers("tip", {6, count}),
               dampers = out.numbers("viscous", {count, count}), losses = out.numbers("loss", {count, count}),
               rest = out.numbers("rest", {6, 6}), unsymmetric = out.numbers("unsymmetric", {}),
               shape = out.numbers("shape", {whole ? count : 0, m.size()}),
               coordinates = out.numbers("coordinates", {m.size()});
  Status* const status = out.each("status", Status::unreachable);
  std::uint32_t* const flags = out.each("flags", 0u);
  parallel_chunks(n, 4, threads, [&](int, long begin, long end) {
    SolveWorkspace ws(m);
    ModesResult r;
    for (long i = begin; i < end; ++i) {
      PoseInput in = loaded(m, position, rotation, wrench, gravity, read, i);
      if (closed.rows() && std::isfinite(closed(i, 0))) in.closed = closed.data() + closed.cols() * i;
      lowest_modes(m, inertias, damping, in, count, whole, ws, r);
      status[i] = r.status;
      flags[i] = r.flags;
      square(i) = r.square;
      tip(i) = r.tip;
      dampers(i) = r.viscous;
      losses(i) = r.loss;
      rest(i) = r.rest;
      unsymmetric(i).setConstant(r.unsymmetric);
      if (whole) shape(i) = r.shape.transpose();
      coordinates(i) = r.x;
    }
  });
  return out;
}

Answers clamps(const Mechanism& m, const Rows& position, const Rows& rotation, const Rows& displacement,
               const std::string& point, const Vec3& gravity, int threads) {
  const Index legs = static_cast<Index>(m.legs.size()), drives = static_cast<Index>(m.drives.size()),
              read = m.point(point);
  check_poses(position, rotation);
  check_rows(displacement, "displacement", position.rows(), 6);
  Answers out(position.rows());
  const Blocks wrench = out.numbers("wrench", {6}), leg_wrench = out.numbers("leg_wrench", {legs, 6}),
               stiffness = out.numbers("stiffness", {6, 6}), leg_stiffness = out.numbers("leg_stiffness", {legs, 6, 6}),
               effort = out.numbers("actuator_effort", {drives}), coordinates = out.numbers("coordinates", {m.size()});
  Status *const status = out.each("status", Status::unreachable), *const force_status =
                                                                      out.each("force_status", Status::unreachable);
  std::uint32_t* const flags = out.each("flags", 0u);
  parallel_chunks(position.rows(), 8, threads, [&](int, long begin, long end) {
    Clamp held(m, read);
    ClampResult r;
    for (long i = begin; i < end; ++i) {
      PoseInput in;
      in.commanded = pose_of(position, rotation, i);
      in.gravity = gravity;
      in.read_points = {read};
      held.solve(in, displacement.row(i).transpose(), r);
      wrench(i) = r.wrench;
      stiffness(i) = r.pose.point.stiffness;
      leg_wrench(i) = r.pose.leg_wrench.transpose();
      for (Index l = 0; l < legs; ++l) leg_stiffness(i).middleRows(6 * l, 6) = r.leg_stiffness[at(l)];
      effort(i) = r.pose.effort;
      coordinates(i) = r.pose.x;
      status[i] = r.status;
      force_status[i] = r.pose.status;
      flags[i] = r.flags;
    }
  });
  return out;
}

Answers reactions(const Mechanism& m, const Rows& position, const Rows& rotation, const Rows& wrench,
                  const std::string& point, const Vec3& gravity, int threads) {
  const Index n = position.rows(), read = m.point(point);
  check_poses(position, rotation);
  check_rows(wrench, "wrench", n, 6);
  Answers out(n);
  const Blocks force = out.numbers("force", {m.size()});
  parallel_chunks(n, 16, threads, [&](int, long begin, long end) {
    SolveWorkspace ws(m);
    PoseResult r;
    for (long i = begin; i < end; ++i) {
      solve_pose(m, loaded(m, position, rotation, wrench, gravity, read, i), {}, ws, r);
      const Linearization& lin = ws.equilibrium.lin;
      if (r.status == Status::converged || r.status == Status::unstable) force(i) = lin.tau - lin.r;
    }
  });
  return out;
}

Answers node_frames(const Mechanism& m, const VecX& x) {
  require(x.size() == m.size(), "coordinates", "one number each", x.size());
  Frames f(m);
  forward(m, Geometry::nominal, x, f);
  Answers out(static_cast<Index>(f.pose.size()));
  const Blocks position = out.numbers("position", {3}), rotation = out.numbers("rotation", {3, 3});
  for (std::size_t i = 0; i < f.pose.size(); ++i) {
    position(static_cast<Index>(i)) = f.pose[i].p;
    rotation(static_cast<Index>(i)) = f.pose[i].R;
  }
  return out;
}

Answers point_positions(const Mechanism& m, const std::string& point, const Rows& x) {
  const NodePoint& named = m.points[at(m.point(point))];
  check_rows(x, "coordinates", x.rows(), m.size());
  Answers out(x.rows());
  const Blocks position = out.numbers("position", {3});
  Frames f(m);
  for (Index i = 0; i < x.rows(); ++i) {
    forward(m, Geometry::nominal, x.row(i).transpose(), f);
    position(i) = f.point(named.node, named.offset);
  }
  return out;
}

}  // namespace stiffmap
