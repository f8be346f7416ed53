// SPDX-License-Identifier: MIT
// What a spin that is let go takes from the stiffness of its leg, in small numbers alone (docs/fast_path.md F21):
// eliminated as a joint it would be the difference of large ones.
#pragma once

#include "newton.hpp"

namespace stiffmap::kernel {

struct LetGo {
  Newton& held;  ///< linearised with the spins held
  const Program& P;
  Scratch& s;

  explicit LetGo(Newton& newton) : held(newton), P(newton.P), s(newton.s) {}

  /// Whether the legs alone bear the tip, so that a leg's change is the platform's.
  static bool possible(const Program& P) {
    const ChainProgram& root = P.chains[P.root];
    if (P.legs_op != root.first_stiff) return false;
    for (int i = root.first; i < root.first + root.count; ++i) {
      const Op& op = P.ops[i];
      if (op.kind == OpKind::load || i == P.legs_op) continue;
      if (op.kind > OpKind::prismatic || op.eliminated) return false;
    }
    const Op& legs = P.ops[P.legs_op];
    for (int i = 0; i < P.spin_count; ++i) {
      const SpinProgram& spin = P.spins[i];
      if (!spin.heavy) continue;
      if (spin.chain < legs.first || spin.chain >= legs.first + legs.count) return false;
      const ChainProgram& chain = P.chains[spin.chain];
      int others = 0;
      for (int k = chain.first; k < chain.first + chain.count; ++k) {
        if (P.ops[k].kind == OpKind::block) return false;
        others += turns(P, P.ops[k]);
      }
      if (others != unknowns || chain.count > most_ops || chain.group >= 0) return false;
    }
    return true;
  }

  /// The platform's stiffness at the point with spin i let go; returns that of the spin, the tip held.
  [[gnu::noinline]] V soften(int i, Sym6& K) {
    chain = P.chains + P.spins[i].chain;
    end = s.branches + P.spins[i].chain;
    spin = P.ops + (P.ops[P.spins[i].first].coordinate == P.spins[i].held ? P.spins[i].first : P.spins[i].last);
    rates();
    move();
    forces();
    V own = splat(0);
    for (int k = 0; k < chain->count; ++k) own += rate[k] * force[k].a.x;
    V6 c = eliminate(own);
    const V6 strained = end->K * left;
    own += dot(left, strained) - 2.0 * dot(left, c);
    c = c - strained;
    c.b = c.b - cross(held.point - end->end.p, c.a);
    downdate(K, c, 1.0 / own);
    return own;
  }

 private:
  static constexpr int unknowns = 5, most_ops = 24;
  const ChainProgram* chain = nullptr;
  const BranchSlot* end = nullptr;
  const Op* spin = nullptr;
  V rate[most_ops];                      ///< of each joint by a unit of the spin
  V6 left;                               ///< twist of the leg's end that they leave
  V6 force[most_ops];                    ///< change of what each joint (in a.x) or spring has to bear
  V3 turned[most_ops], moved[most_ops];  ///< turn of the frame before, motion of the joint or centre

  const Op& op(int k) const { return P.ops[chain->first + k]; }
  const JointSlot& slot(int k) const { return s.joints[op(k).slot]; }

  /// A joint that nothing but the closure holds.
  static bool turns(const Program& P, const Op& o) {
    if (o.kind > OpKind::prismatic || !o.eliminated) return false;
    const CoordinateProgram& c = P.coordinates[o.coordinate];
    return c.role == 1 && c.law < 0 && c.stiffness == 0;
  }

  V6 twist(int k) const {
    const JointSlot& j = slot(k);
    return op(k).kind == OpKind::prismatic ? V6{j.w, V3{}} : V6{cross(j.w, end->end.p - j.o), j.w};
  }

  /// Rates of the other joints that keep the leg's end still but for what no joint can: least squares. They need not be
  /// exact, what they leave is computed from them.
  void rates() {
    int place[unknowns] = {};
    V6 column[unknowns];
    V A[unknowns][unknowns], x[unknowns];
    const auto weighed = [&](V6 t) {
      t.b = splat(P.length) * t.b;
      return t;
    };
    int n = 0;
    for (int k = 0; k < chain->count; ++k) {
      rate[k] = splat(0);
      if (turns(P, op(k)) && n < unknowns) place[n++] = k;
      if (&op(k) != spin) continue;
      rate[k] = splat(1);
      left = twist(k);
    }
    for (int i = 0; i < unknowns; ++i) column[i] = weighed(twist(place[i]));
    for (int i = 0; i < unknowns; ++i) {
      x[i] = -dot(column[i], weighed(left));
      for (int k = 0; k <= i; ++k) A[i][k] = A[k][i] = dot(column[i], column[k]);
    }
    for (int k = 0; k < unknowns; ++k)
      for (int i = k + 1; i < unknowns; ++i) {
        const V f = A[i][k] / A[k][k];
        for (int q = k; q < unknowns; ++q) A[i][q] -= f * A[k][q];
        x[i] -= f * x[k];
      }
    for (int i = unknowns - 1; i >= 0; --i) {
      for (int q = i + 1; q < unknowns; ++q) x[i] -= A[i][q] * x[q];
      x[i] = x[i] / A[i][i];
      rate[place[i]] = x[i];
      left = left + x[i] * twist(place[i]);
    }
  }

  /// How the frames of the leg move; springs as they are.
  void move() {
    V3 turn{}, motion{}, at = held.s.stiff[P.ops[P.legs_op].slot].start.p;
    const auto go = [&](const V3& to) {
      motion = motion + cross(turn, to - at);
      at = to;
    };
    for (int k = 0; k < chain->count; ++k) {
      const Op& o = op(k);
      turned[k] = turn;
      if (o.kind == OpKind::spring) {
        go(s.stiff[o.slot].p);
        moved[k] = motion;
      } else if (o.kind == OpKind::load) {
        moved[k] = motion + cross(turn, slot(k).o + slot(k).w - at);
      } else {
        go(slot(k).o);
        moved[k] = motion;
        if (o.kind == OpKind::revolute) turn = turn + rate[k] * slot(k).w;
        else motion = motion + rate[k] * slot(k).w;
      }
    }
    last = motion + cross(turn, end->end.p - at);
  }
  V3 last;  ///< motion of the leg's end

  /// Moments change as forces, whose directions stay, move (theory E4).
  void forces() {
    V3 sum = cross(last, end->F.a);
    for (int k = chain->count - 1; k >= 0; --k) {
      const Op& o = op(k);
      force[k] = V6{};
      if (o.kind == OpKind::load) {
        sum = sum + cross(moved[k], splat(o.mass) * held.e.gravity);
      } else if (o.kind == OpKind::spring) {
        const V6& F = s.stiff[o.slot].F;
        force[k] = {cross(turned[k], F.a), cross(turned[k], F.b) - (sum - cross(moved[k], F.a))};
      } else if (o.kind == OpKind::prismatic) {
        force[k].a.x = -dot(cross(turned[k], slot(k).w), slot(k).F.a);
      } else {
        const V3 change = sum - cross(moved[k], slot(k).F.a);
        force[k].a.x = -dot(cross(turned[k], slot(k).w), slot(k).F.b) - dot(slot(k).w, change);
      }
    }
  }

  /// The same with the leg's end held and all else where it comes to rest: at the end; `own` loses what that gives way.
  V6 eliminate(V& own) {
    V6 c{};
    V3 p{};
    const auto move_to = [&](const V3& to) {
      c.b = c.b - cross(to - p, c.a);
      p = to;
    };
    const auto joint = [&](int k) {
      const JointSlot& j = slot(k);
      const V da = s.da[op(k).coordinate], y = (dot(j.J, c) - force[k].a.x) * j.inverse;
      own -= da * y * y / j.inverse;
      c = c - (da * y) * j.u;
    };
    const int first = chain->first_stiff - chain->first;
    for (int k = first; k < chain->count; ++k) {
      const Op& o = op(k);
      if (o.kind == OpKind::load || (o.kind <= OpKind::prismatic && !o.eliminated)) continue;
      if (o.kind <= OpKind::prismatic) {
        move_to(slot(k).o);
        joint(k);
        continue;
      }
      const StiffSlot& spring = s.stiff[o.slot];
      if (k == first) {
        c = force[k];
        p = spring.p;
        for (int q = k - 1; q >= 0; --q)
          if (op(q).kind <= OpKind::prismatic && op(q).eliminated) joint(q);
        continue;
      }
      move_to(spring.p);
      V y[6], full[6] = {};
      put(c - force[k], y);
      for (int i = 0; i < 6; ++i) {
        for (int q = 0; q < i; ++q) y[i] -= spring.L[i][q] * y[q];
        const V scaled = spring.inverse[i] * y[i];
        own -= scaled * y[i];
        for (int q = 0; q < 6; ++q) full[q] += spring.X[i][q] * scaled;
      }
      c = c - get(full);
    }
    move_to(end->end.p);
    return c;
  }
};

}  // namespace stiffmap::kernel
