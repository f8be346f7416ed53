// SPDX-License-Identifier: MIT
// All loads of the tip's body as one wrench about the point of the answer, and what their turning with the tip and
// their lever arms take from the tangent of a dead wrench (docs/fast_path.md F18, F20). Apart from the other passes:
// one dead load at the point keeps its code and its bits.
#pragma once

#include "frames.hpp"
#include "turning_load.hpp"

namespace stiffmap::kernel {

struct TipLoads {
  static constexpr int most_near = 4;
  const Program* P = nullptr;
  const KernelInput* in = nullptr;
  M3 command;            ///< the tip's rotation at the command
  M3 before;             ///< the same as the point of the answer turned
  std::int64_t pose[W];  ///< of each lane
  V6 near[most_near];    ///< the first further loads as they were given, about their own points
  TipLoads() {}          // not filled with zeros

  /// Loads of the poses `of` a block, whose tips stand at `R` by their command.
  template <class PoseOf>
  void read(const Program& program, const KernelInput& input, const M3& R, const PoseOf& of) {
    in = &input;
    command = R;
    for (int i = 0; i < W; ++i) pose[i] = of(i);
    stand_on(program);
    for (int i = 0; i < in->load_count && i < most_near; ++i) near[i] = read(i);
  }

  /// The same loads on a variant of the machine.
  void stand_on(const Program& program) {
    P = &program;
    before = before_of(in->point);
  }

  /// Whether the wrench about the point is another when the tip turns.
  bool turns() const { return in->turns != LoadTurns::dead || in->load_count > 0; }
  bool one_follower() const { return in->turns == LoadTurns::follower && in->load_count == 0; }
  bool several() const { return in->load_count > 0; }
  /// Whether some load does not keep its direction.
  bool some_turns() const {
    bool some = in->turns != LoadTurns::dead;
    for (int i = 0; i < in->load_count; ++i) some |= in->loads[i].turns != LoadTurns::dead;
    return some;
  }

  /// What an arm's joints ask of several loads: the sum of lever arms from the point times forces, and the moment
  /// without them.
  struct Levers {
    M3 arms;
    V3 moment;
  };

  /// The wrench about the point where the tip stands at R; `w` is what acts at the point itself.
  [[gnu::noinline]] V6 at(const V6& w, const M3& R) const {
    if (!several()) return TurningLoad{in->turns, before}.at(w, R);
    V6 sum = TurningLoad{in->turns, before}.at(w, R);
    for (int i = 0; i < in->load_count; ++i) {
      const V6 now = load_at(i, R);
      sum = sum + V6{now.a, now.b + cross(R * arm(i), now.a)};
    }
    return sum;
  }

  [[gnu::noinline]] Levers levers(const V6& w, V share, const M3& R) const {
    Levers out{{}, share * TurningLoad{in->turns, before}.at(w, R).b};
    for (int i = 0; i < in->load_count; ++i) {
      const V6 now = share * load_at(i, R);
      const V3 r = R * arm(i);
      add_lever(out.arms, r, now.a);
      out.moment = out.moment + now.b;
    }
    return out;
  }

  /// `rigid`: with the turning of the lever arms, the forces as they are; else what the loads' own turning makes.
  [[gnu::noinline]] Change change(const V6& w, const M3& R, bool rigid = true) const {
    if (!several()) return TurningLoad{in->turns, before}.change(w, R);
    Change out = TurningLoad{in->turns, before}.change(w, R);
    for (int i = 0; i < in->load_count; ++i) {
      const M3 then = before_of(in->loads[i].place);
      const TurningLoad load{in->loads[i].turns, then};
      const V6 wrench = given(i);
      const V3 force = load.at(wrench, R).a, r = R * arm(i);
      const Change own = load.change(wrench, R);
      for (int k = 0; k < 3; ++k) {
        const V6& by = own.about[k];
        V3 lever = cross(r, by.a);
        if (rigid) lever = lever + cross(cross(TurningLoad::unit(k), r), force);
        out.about[k] = out.about[k] + V6{by.a, by.b + lever};
      }
    }
    return out;
  }

  /// Takes the change under a share of the loads from the tangent of a dead wrench.
  [[gnu::noinline]] void soften(const V6& w, V share, const M3& R, V (&m)[6][6]) const {
    const Change c = change(w, R);
    for (int k = 0; k < 3; ++k) {
      V column[6];
      put(share * c.about[k], column);
      for (int i = 0; i < 6; ++i) m[i][3 + k] -= column[i];
    }
  }

  /// From the symmetric part of a tangent that has the change to the one of a dead wrench.
  [[gnu::noinline]] void symmetric(const V6& w, V share, const M3& R, Sym6& K) const {
    Change c = change(w, R);
    for (V6& about : c.about) about = share * about;
    const V3 &x = c.about[0].b, &y = c.about[1].b, &z = c.about[2].b;
    for (int k = 0; k < 3; ++k) K.B.c[k] = K.B.c[k] + splat(0.5) * c.about[k].a;
    K.E.xx += x.x;
    K.E.yy += y.y;
    K.E.zz += z.z;
    K.E.xy += 0.5 * (y.x + x.y);
    K.E.xz += 0.5 * (z.x + x.z);
    K.E.yz += 0.5 * (z.y + y.z);
  }

  /// Lanes in which a load besides the first acts, and those in which it has no potential (as `nonconservative`).
  M acting() const {
    M some{};
    for (int i = 0; i < in->load_count; ++i) some |= pushes(given(i).a) | pushes(given(i).b);
    return some;
  }
  M circulatory() const {
    M some{};
    for (int i = 0; i < in->load_count; ++i) some |= circulatory(in->loads[i].turns, given(i));
    return some;
  }
  static M circulatory(LoadTurns how, const V6& w) {
    if (how == LoadTurns::semitangential) return M{};
    return how == LoadTurns::follower ? pushes(w.a) | pushes(w.b) : pushes(w.b);
  }

 private:
  static M pushes(const V3& v) { return absolute(v.x) + absolute(v.y) + absolute(v.z) > 0.0; }

  /// The rotation that an error's turn of a place leaves of the command's.
  M3 before_of(std::int32_t at) const {
    const PlaceProgram& place = P->places[at];
    if (!place.turned) return command;
    const M3 nominal = constant_rotation(place.nominal.R), a = constant_rotation(place.actual.R);
    const M3 back{{{a.c[0].x, a.c[1].x, a.c[2].x}, {a.c[0].y, a.c[1].y, a.c[2].y}, {a.c[0].z, a.c[1].z, a.c[2].z}}};
    return command * (nominal * back);
  }

  V6 load_at(int i, const M3& R) const {
    const M3 then = before_of(in->loads[i].place);
    return TurningLoad{in->loads[i].turns, then}.at(given(i), R);
  }

  /// Load i as it was given, about its own point.
  V6 given(int i) const { return i < most_near ? near[i] : read(i); }

  [[gnu::noinline]] V6 read(int i) const {
    alignas(64) double value[6][W];
    for (int lane = 0; lane < W; ++lane) {
      const double* w = in->wrench + 6 * ((in->one_wrench ? 0 : (1 + in->load_count) * pose[lane]) + 1 + i);
      for (int c = 0; c < 6; ++c) value[c][lane] = w[c];
    }
    V v[6];
    for (int c = 0; c < 6; ++c) v[c] = kernel::load(value[c]);
    return get(v);
  }

  /// From the point to that of load i, in the tip's frame.
  V3 arm(int i) const {
    const double *to = P->places[in->loads[i].place].actual.p, *from = P->places[in->point].actual.p;
    return {splat(to[0] - from[0]), splat(to[1] - from[1]), splat(to[2] - from[2])};
  }
};

}  // namespace stiffmap::kernel
