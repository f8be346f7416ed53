// SPDX-License-Identifier: MIT
// What a block of poses answers: which poses its lanes are, how each ended, and its rows of the arrays.
#pragma once

#include "newton.hpp"
#include "places.hpp"

namespace stiffmap::kernel {

/// W poses; lanes beyond `count` repeat the last pose and are not written.
struct Answers {
  const Program& P;
  const KernelInput& in;
  const KernelOutput& out;
  Scratch& s;
  std::int64_t first;
  int count;
  Frame command = {};
  M never = {};  ///< lanes out of reach
  M closed = {};
  M unstable = {}, ended = {}, unverified = {}, nowhere = {};
  M unfinished = {};  ///< on a load path, or across corners, in more steps than most lanes take
  M stuck = {};       ///< in equilibrium, but not where spins come to rest

  std::int64_t place(int lane) const { return first + (lane < count ? lane : count - 1); }
  std::int64_t pose(int lane) const { return in.index ? in.index[place(lane)] : place(lane); }

  /// Lanes in which a ball joint's axes that are meant are less than `least` from coinciding, at the command.
  M locked(double least) const {
    M hit{};
    for (int q = 0; q < P.coordinate_count; ++q) {
      if (P.coordinates[q].ball != 1) continue;
      V sn, cs;
      sincos(s.closed[q] - P.coordinates[q].middle, sn, cs);
      hit |= absolute(cs) < least;
    }
    return hit;
  }

  /// Lanes in which a free ball joint is near the lock of its axes: there the balance of moments says little about one
  /// direction, and the reference path counts by other axes (theory C8).
  [[gnu::noinline]] M near_lock(const V* x) const {
    M hit{};
    for (int q = 0; q < P.coordinate_count; ++q) {
      if (P.coordinates[q].ball != 2) continue;
      V sn, cs;
      sincos(x[q] - P.coordinates[q].middle, sn, cs);
      hit |= ~(absolute(cs) > P.narrow);
    }
    return hit;
  }

  /// What is said of the command of poses without an answer.
  [[gnu::noinline]] void flag_command(M lanes, std::uint32_t also) {
    const M lock = locked(P.near_lock);
    for (int i = 0; i < count; ++i) {
      if (!lanes[i]) continue;
      std::uint32_t flags = also | (lock[i] ? P.flag_lock : 0u);
      for (int q = 0; q < P.coordinate_count; ++q) {
        const CoordinateProgram& k = P.coordinates[q];
        if (s.closed[q][i] < k.lower || s.closed[q][i] > k.upper) flags |= k.role == 0 ? P.flag_range : P.flag_limit;
      }
      out.flags[pose(i)] = flags;
    }
  }

  /// What becomes of a lane that was given up.
  std::uint8_t left(int lane) const {
    if (nowhere[lane]) return pose_nowhere;
    if (ended[lane]) return pose_ended;
    if (stuck[lane]) return pose_left;
    if (unfinished[lane] && in.patience == Patience::path) return pose_heavy;
    if (in.patience >= Patience::path) return pose_left;
    if (closed[lane]) return pose_heavy;
    return in.patience == Patience::leaps ? pose_left : pose_slow;
  }

  std::uint8_t solved(int lane, const Newton& newton) const {
    return unstable[lane] ? pose_unstable : newton.serial.play.lanes[lane] ? pose_loose : pose_solved;
  }

  void write(M done, const Newton& newton, const V (&K)[6][6], const V (&C)[6][6], V iterations, V steps) {
    const V3 offset = commanded_offset();
    const V6 d{newton.point - (command.p + command.R * offset),
               rotation_since(P.places[in.point], command.R, newton.tip.R)};
    V moved[6];
    put(d, moved);
    for (int i = 0; i < count; ++i) {
      const std::int64_t k = pose(i);
      out.done[k] = done[i] ? solved(i, newton) : never[i] ? pose_unreachable : left(i);
      if (out.iterations && (done[i] || nowhere[i])) out.iterations[k] = static_cast<std::int32_t>(iterations[i]);
    }
    const M wanted = done & written();
    put_out(moved, 6, wanted, out.displacement, 6 * (1 + in.read_count));
    if (in.read_count > 0 && out.displacement) write_readings(wanted, newton);
    put_out(K[0], 36, wanted, out.stiffness);
    put_out(C[0], 36, wanted, out.compliance);
    put_out(s.x, P.coordinate_count, wanted, out.coordinates);
    const M high = write_efforts(wanted);
    write_flags(wanted, high, steps, newton.P.flag_always);
    write_leg_wrenches(wanted, newton.point);
    if (out.free_twists && any(newton.serial.play.lanes)) write_play(done & newton.serial.play.lanes, newton);
  }

  /// The point of the answer in the tip's frame, as the command knows it.
  V3 commanded_offset() const {
    const double* o = P.places[in.point].nominal.p;
    return {splat(o[0]), splat(o[1]), splat(o[2])};
  }

  /// Displacements of the further places (docs/fast_path.md F20).
  [[gnu::noinline]] void write_readings(M wanted, const Newton& newton) const {
    const double* o = P.places[in.point].actual.p;
    const Frame tip{newton.point - newton.tip.R * V3{splat(o[0]), splat(o[1]), splat(o[2])}, newton.tip.R};
    for (int k = 0; k < in.read_count; ++k) {
      const PlaceProgram& place = P.places[in.reads[k]];
      const Frame now = frame_of<Build::actual>(P, place, s.x, tip);
      V moved[6];
      put(frame_error(frame_of<Build::nominal>(P, place, s.closed, command), now), moved);
      put_out(moved, 6, wanted, out.displacement + 6 * (1 + k), 6 * (1 + in.read_count));
    }
  }

  [[gnu::noinline]] void write_play(M lanes, const Newton& newton) {
    const V6& t = newton.serial.play.twist;
    V twist[6];
    put((1.0 / root(dot(t, t))) * t, twist);
    for (int i = 0; i < count; ++i)
      if (lanes[i])
        for (int r = 0; r < 6; ++r) out.free_twists[36 * pose(i) + 6 * r] = twist[r][i];
  }

  /// Lanes in which a drive bears more than it can.
  M write_efforts(M wanted) const {
    M high{};
    V* const efforts = s.dz;  // no step is taken any more
    for (int d = 0; d < P.drive_count; ++d) {
      const DriveProgram& k = P.drives[d];
      if (k.slot < 0) {  // a winch
        efforts[d] = -s.tau[k.coordinate];
        high |= absolute(efforts[d]) > k.force_limit;
        continue;
      }
      const JointSlot& j = s.joints[k.slot];
      efforts[d] = P.coordinates[k.coordinate].locked ? -dot(j.w, k.prismatic ? j.F.a : j.F.b) : -s.tau[k.coordinate];
      high |= absolute(efforts[d]) > k.force_limit;
    }
    put_out(efforts, P.drive_count, wanted, out.effort);
    return high;
  }

  void write_flags(M wanted, M high, V steps, std::uint32_t always) const {
    M range{}, limit{};
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      const M off = (s.closed[q] < k.lower) | (s.closed[q] > k.upper);
      if (k.role == 0) range |= off;
      if (k.role == 1) limit |= off;
    }
    M slack{};
    for (int i = 0; i < P.spring_count; ++i)
      if (P.springs[i].coordinate >= 0) slack |= ~(s.tau[P.springs[i].coordinate] > 0.0);
    const M lock = locked(P.near_lock), stepped = steps > 0.0;
    const M flags = bits(always) | (lock & bits(P.flag_lock)) | (high & bits(P.flag_force)) |
                    (range & bits(P.flag_range)) | (limit & bits(P.flag_limit)) | (stepped & bits(P.flag_stepped)) |
                    (unverified & bits(P.flag_unverified)) | (slack & bits(P.flag_slack));
    each_lane(wanted, [&](int i) { out.flags[pose(i)] = static_cast<std::uint32_t>(flags[i]); });
  }

  void write_leg_wrenches(M wanted, const V3& point) const {
    if (!out.leg_wrench || P.legs_op < 0) return;
    const Op& block = P.ops[P.legs_op];
    for (int b = 0; b < block.count; ++b) {
      const BranchSlot& branch = s.branches[block.first + b];
      const V3 m = branch.F.b + cross(branch.end.p - point, branch.F.a);
      const V w[6] = {-branch.F.a.x, -branch.F.a.y, -branch.F.a.z, -m.x, -m.y, -m.z};
      put_out(w, 6, wanted, out.leg_wrench + 6 * b, 6 * block.count);
    }
  }

  /// Lanes that are poses of their own.
  M written() const {
    M own{};
    for (int i = 0; i < count; ++i) own[i] = -1;
    return own;
  }

  /// Each pose's `n` numbers into its row of `to`, if that is wanted.
  void put_out(const V* values, int n, M wanted, double* to) const { put_out(values, n, wanted, to, n); }
  void put_out(const V* values, int n, M wanted, double* to, std::int64_t row) const {
    if (!to) return;
    double* rows[W];
    for (int i = 0; i < W; ++i) rows[i] = to + row * pose(i);
    write_lanes(values, n, wanted, rows);
  }
};

}  // namespace stiffmap::kernel
