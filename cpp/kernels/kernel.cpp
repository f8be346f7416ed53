// SPDX-License-Identifier: MIT
// Compiled once per instruction-set level into a private library with one exported symbol.
// No globals, no streams, no exceptions, no Eigen: docs/fast_path.md.
#include <cstddef>
#include <initializer_list>

#include "answers.hpp"
#include "closing.hpp"
#include "command_errors.hpp"
#include "floating.hpp"
#include "hanging.hpp"
#include "last_attempt.hpp"
#include "load_path.hpp"
#include "residual.hpp"
#include "strokes.hpp"

#ifndef STIFFMAP_LEVEL
#define STIFFMAP_LEVEL "base"
#endif

namespace stiffmap::kernel {
namespace {

template <class T>
T* take(char*& at, std::int64_t count) {
  T* out = reinterpret_cast<T*>(at);
  at += (static_cast<std::int64_t>(sizeof(T)) * count + 63) / 64 * 64;
  return out;
}

Scratch lay_out(const Program& P, void* memory, std::int64_t* bytes) {
  char* at = reinterpret_cast<char*>((reinterpret_cast<std::uintptr_t>(memory) + 63) / 64 * 64);
  char* const begin = at;
  Scratch s;
  s.joints = take<JointSlot>(at, P.joint_slots);
  s.stiff = take<StiffSlot>(at, P.stiff_slots);
  s.groups = take<GroupSlot>(at, P.group_slots);
  s.strokes = take<StrokeSlot>(at, P.stroke_count);
  s.branches = take<BranchSlot>(at, P.chain_count);
  const int n = P.coordinate_count;
  for (V** v : {&s.x, &s.z, &s.dz, &s.a_base, &s.tau, &s.da, &s.dtau, &s.scale, &s.linear, &s.curve, &s.closed,
                &s.friction_sign, &s.kept, &s.slope, &s.second, &s.third, &s.rest})
    *v = take<V>(at, n);
  if (bytes) *bytes = at - begin + 64;
  return s;
}

std::int64_t scratch_size(const Program* P) {
  std::int64_t bytes = 0;
  lay_out(*P, nullptr, &bytes);
  return bytes;
}

/// One block of poses, from what is asked to what is answered.
struct Block : Answers {
  V6 load = {};

  /// What the poses ask; where they are given, the closed coordinates too: lanes without are not usable.
  M read() {
    V* const lanes[] = {&command.p.x,      &command.p.y,      &command.p.z,      &command.R.c[0].x, &command.R.c[1].x,
                        &command.R.c[2].x, &command.R.c[0].y, &command.R.c[1].y, &command.R.c[2].y, &command.R.c[0].z,
                        &command.R.c[1].z, &command.R.c[2].z, &load.a.x,         &load.a.y,         &load.a.z,
                        &load.b.x,         &load.b.y,         &load.b.z};
    alignas(64) double value[18][W];
    for (int i = 0; i < W; ++i) {
      const std::int64_t k = in.start ? place(i) : pose(i);
      for (int c = 0; c < 3; ++c) value[c][i] = in.position[3 * k + c];
      for (int c = 0; c < 9 && !in.one_rotation; ++c) value[3 + c][i] = in.rotation[9 * k + c];
      for (int c = 0; c < 6 && !in.one_wrench; ++c) value[12 + c][i] = in.wrench[6 * (1 + in.load_count) * pose(i) + c];
    }
    for (int c = 0; c < 3; ++c) *lanes[c] = kernel::load(value[c]);
    for (int c = 0; c < 9; ++c) *lanes[3 + c] = in.one_rotation ? splat(in.rotation[c]) : kernel::load(value[3 + c]);
    for (int c = 0; c < 6; ++c) *lanes[12 + c] = in.one_wrench ? splat(in.wrench[c]) : kernel::load(value[12 + c]);
    return in.start ? given() : close();
  }

  M given() {
    M usable{};
    for (int i = 0; i < W; ++i) {
      const double* x = in.start + P.coordinate_count * place(i);
      bool finite = true;
      for (int q = 0; q < P.coordinate_count; ++q) {
        s.x[q][i] = x[q];
        finite = finite && x[q] == x[q];
      }
      usable[i] = finite ? -1 : 0;
    }
    return usable;
  }

  M close() {
    if (P.floating) {
      Floating::close(P, command, s);
      return ~M{};
    }
    const double* at[W];
    for (int i = 0; i < W; ++i) at[i] = in.position + 3 * pose(i);
    Closing closing{P, s};
    const M ok = closing.close(command, at, in.patience >= Patience::leaps);
    never = closing.never & ~ok;
    if (P.open_task) {  // the closed machine completes the command
      command = Closing::base_frame();
      walk<Build::nominal>(P, P.chains[P.root], s.x, command, s);
    }
    wind(P, command, s);
    return ok;
  }

  /// Drives and guides with their errors; every coordinate's value at zero deflection (theory G1-G3); springs at
  /// their stroke (S3). Lanes in which these are declared.
  M set_base(const Program& of) {
    for (int q = 0; q < of.coordinate_count; ++q) {
      const CoordinateProgram& k = of.coordinates[q];
      s.a_base[q] = k.role == 2 ? splat(k.stiffness > 0 ? 0 : k.rest) : k.from_home ? splat(k.rest) : s.closed[q];
      s.scale[q] = splat(1);
    }
    for (int d = 0; d < of.drive_count; ++d) {
      const DriveProgram& k = of.drives[d];
      if (k.compliance_slope != 0) s.scale[k.coordinate] = 1.0 + k.compliance_slope * (s.closed[k.coordinate] - k.home);
    }
    for (int q = 0; q < of.coordinate_count; ++q) {
      const CoordinateProgram& k = of.coordinates[q];
      if (k.law < 0) continue;
      s.linear[q] = of.laws[k.law].stiffness / s.scale[q];
      if (k.by_force) s.curve[q] = root(of.laws[k.law].cubic / s.linear[q]);
    }
    for (int i = 0; i < of.error_count; ++i) {
      const CommandErrorProgram& k = of.errors[i];
      s.a_base[k.coordinate] += command_error(of, k, s.closed[k.of]);
    }
    if (of.sags) sag(of);
    return set_strokes(of, s);
  }

  /// Each drive by what the tip rises with it (theory G4).
  void sag(const Program& of) {
    Frame tip = Closing::base_frame();
    walk<Build::nominal>(of, of.chains[of.root], s.closed, tip, s);
    const V3 g{splat(in.gravity[0]), splat(in.gravity[1]), splat(in.gravity[2])};
    const bool weighs = in.gravity[0] != 0 || in.gravity[1] != 0 || in.gravity[2] != 0;
    const V3 up = weighs ? (-1.0 / root(dot(g, g))) * g : V3{splat(0), splat(0), splat(1)};
    for (int d = 0; d < of.drive_count; ++d) {
      const DriveProgram& k = of.drives[d];
      if (k.sag == 0) continue;
      const JointSlot& joint = s.joints[k.slot];
      s.a_base[k.coordinate] -= k.sag * dot(up, cross(joint.w, tip.p - joint.o));
    }
  }

  M set_start() {
    for (int q = 0; q < P.coordinate_count; ++q) {
      s.closed[q] = s.x[q];
      s.da[q] = splat(1);
      s.tau[q] = s.dtau[q] = s.friction_sign[q] = splat(0);
    }
    const M known = set_base(P);
    stand_at_start(~M{});
    return known;
  }

  /// The closed configuration, no wrench in any branch.
  void stand_at_start(M lanes) {
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      V z = splat(0);
      if (k.from_home) z = s.closed[q] - k.rest;
      if (k.from_home && k.by_force) z += s.curve[q] * s.curve[q] * z * z * z;
      s.z[q] = select(lanes, z, s.z[q]);
    }
    for (int k = 0; k < P.chain_count; ++k) s.branches[k].F = select(lanes, V6{}, s.branches[k].F);
  }

  /// Frames and wrenches of a program's machine at the coordinates found.
  void pass(Newton& at, const Program& of) {
    set_base(of);
    at.laws.evaluate(false);
    at.frames_and_wrenches();
  }

  /// Displacement of each variant after one step from here, with the factors of the base (F10).
  void vary(M done, const Newton& base, const V (&C)[6][6]) {
    const V3 offset = commanded_offset();
    Elimination own{P, s, base.e.gravity, splat(0), {}};
    Newton here{P, in, s, own, load, own.gravity};
    here.turning = base.turning;
    pass(here, P);
    residual(own, P.chains[P.root], here.point);
    std::int32_t moved = Elimination::all;  // leg whose slots hold a variant
    for (int v = 0; v < in.perturbed_count; ++v) {
      const Program& Q = *in.perturbed[v];
      Elimination e{Q, s, base.e.gravity, splat(0), {}};
      e.together = true;
      e.only = in.perturbed_leg[v] < 0 ? Elimination::all_anew : in.perturbed_leg[v];
      if (e.only >= 0 && moved != Elimination::all && moved != e.only) pass(here, P);
      moved = e.only;
      Newton at{Q, in, s, e, load, e.gravity};
      at.turning = base.turning;
      at.turning.stand_on(Q);
      pass(at, Q);
      V c[6], eta[6];
      put(residual(e, Q.chains[Q.root], at.point), c);
      for (int i = 0; i < 6; ++i) {
        eta[i] = splat(0);
        for (int q = 0; q < 6; ++q) eta[i] -= C[i][q] * c[q];
      }
      const V6 step = get(eta);
      // Rotation vectors add to first order only: turn the frame by the step, then compare.
      const M3 R = turned_by(at.tip.R, step.b);
      const V6 d{at.point + step.a - (command.p + command.R * offset),
                 rotation_since(Q.places[in.point], command.R, R)};
      put(d, c);
      for (int i = 0; i < count; ++i)
        if (done[i])
          for (int r = 0; r < 6; ++r) out.perturbed[6 * (in.perturbed_count * pose(i) + v) + r] = c[r][i];
    }
  }

  void run() {
    M usable = read();
    const M declared = set_start();
    if (any(usable & ~declared)) {  // they close, but where a spring is not declared: no pose of the machine
      const M beyond = usable & beyond_strokes(P, s);
      never |= beyond;
      flag_command(beyond, 0);
    }
    usable &= declared;
    closed = usable;
    if (P.free_balls) usable &= ~near_lock(s.closed);
    const double f = __builtin_sqrt(P.stiffness), g = f * P.length;
    Elimination e{
        P, s, {splat(in.gravity[0]), splat(in.gravity[1]), splat(in.gravity[2])}, splat(0), {f, f, f, g, g, g}};
    e.heavy = in.gravity[0] != 0 || in.gravity[1] != 0 || in.gravity[2] != 0;
    Newton newton{P, in, s, e, load, e.gravity};
    newton.turning.read(P, in, command.R, [&](int lane) { return pose(lane); });
    V iterations = splat(0), steps = splat(0);
    if (P.floating) return float_down(usable, newton, iterations);
    const bool path = in.patience >= Patience::path && !P.starts_linear && !P.deficient;
    // Poses of the passes for paths are those that Newton's first steps do not settle.
    M done =
        path ? follow(usable, newton, iterations, steps) : newton.solve(usable, P.starts_linear, iterations, steps);
    if (newton.steps_by_deflections()) unfinished = usable & ~done;  // in shorter steps across corners
    if (P.free_balls) done &= ~drop_locked();
    if (P.hanging && e.heavy) return hang(done, newton, iterations, steps);
    V K[6][6];
    newton.dense(newton.answer.K, K);
    write(done, newton, K, newton.answer.compliance, iterations, steps);
    if (in.perturbed_count == 0) return;
    newton.linearize();  // lanes that settled early have lost their factors
    vary(done & ~unstable & ~newton.serial.play.lanes, newton, newton.answer.compliance);
  }

  [[gnu::noinline]] void float_down(M usable, Newton& newton, V iterations) {
    Floating floating{P, in, s, newton};
    const M done = floating.run(usable, iterations);
    unverified = floating.far;
    V K[6][6];
    newton.dense(newton.answer.K, K);
    write(done, newton, K, newton.answer.compliance, iterations, splat(0));
  }

  /// Lanes whose answer, or whose end, is near the lock of a free ball: nothing is said of them here.
  M drop_locked() {
    const M lost = near_lock(s.x);
    unstable &= ~lost;
    ended &= ~lost;
    nowhere &= ~lost;
    return lost;
  }

  /// What weights turn is let go.
  [[gnu::noinline]] void hang(M held, Newton& newton, V iterations, V steps) {
    Elimination e = {*P.hanging, s, newton.whole_gravity, splat(0), {}};
    for (int i = 0; i < 6; ++i) e.scale[i] = newton.e.scale[i];
    e.heavy = true;
    Newton loose{*P.hanging, in, s, e, load, newton.whole_gravity};
    loose.turning = newton.turning;
    M done = Hanging{loose, newton}.settle(held & ~unstable, iterations);
    if (P.free_balls) done &= ~near_lock(s.x);
    stuck = held & ~done;
    V K[6][6];
    loose.dense(loose.answer.K, K);
    write(done, loose, K, loose.answer.compliance, iterations, steps);
  }

  M follow(M lanes, Newton& newton, V& iterations, V& steps) {
    stand_at_start(lanes);
    LoadPath path{newton};
    const int most = in.patience == Patience::path ? LoadPath::most_of_most : LoadPath::most_iterations;
    M done = path.follow(lanes, most, iterations, [&](M anew) { stand_at_start(anew); });
    unstable = path.unstable;
    if (P.spring_count == 0) ended = path.ended;  // what such springs hold, the reference may follow farther
    unfinished = path.unfinished;
    if (any(ended) && LastAttempt::possible(newton)) done |= attempt(newton, iterations);
    steps = select(lanes, splat(1), steps);
    newton.settle();
    return done;
  }

  M attempt(Newton& newton, V& iterations) {
    stand_at_start(ended);
    LastAttempt last(newton);
    iterations = select(ended, splat(0), iterations);  // as the reference counts
    last.run(ended, iterations);
    unverified = last.found;
    unstable |= last.unstable;
    nowhere = last.nowhere;
    flag_command(nowhere, P.flag_stepped | P.flag_unverified);
    return last.found;
  }
};

void run(const Program* P, const KernelInput* in, const KernelOutput* out, std::int64_t begin, std::int64_t end,
         void* scratch) {
  Scratch s = lay_out(*P, scratch, nullptr);
  for (std::int64_t i = begin; i < end; i += W) {
    const int count = static_cast<int>(end - i < W ? end - i : W);
    Block block{{*P, *in, *out, s, i, count}};
    block.run();
  }
}

}  // namespace
}  // namespace stiffmap::kernel

extern "C" __attribute__((visibility("default"))) void STIFFMAP_ENTRY(stiffmap::KernelTable* table) {
  *table = {STIFFMAP_LEVEL, stiffmap::kernel::W, stiffmap::program_layout, &stiffmap::kernel::scratch_size,
            &stiffmap::kernel::run};
}
