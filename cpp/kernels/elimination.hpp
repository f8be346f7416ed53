// SPDX-License-Identifier: MIT
// The O(n) elimination: wrenches from the tip to the base, tangents from the base to the tip, steps
// back again (docs/fast_path.md F2-F9). One relative problem per chain: its start frame held.
#pragma once

#include "frames.hpp"

namespace stiffmap::kernel {

/// What the passes share.
struct Elimination {
  const Program& P;
  Scratch& s;
  V3 gravity;
  V lowest;  ///< smallest pivot, dimensionless: at or below zero the pose is not a plain minimum
  double scale[6];
  V transferred = splat(0);  ///< largest step of a branch's wrench, over stiffness times length

  // ---- wrenches -------------------------------------------------------------------------------
  static void shift(V6& F, const V3& from, const V3& to) { F.b = F.b + cross(from - to, F.a); }

  /// From the wrench F at point p of the chain's end to the one at its start point.
  void wrenches(const ChainProgram& chain, V6& F, V3& p) {
    for (int i = chain.first + chain.count - 1; i >= chain.first; --i) {
      const Op& op = P.ops[i];
      switch (op.kind) {
        case OpKind::revolute:
        case OpKind::prismatic: {
          JointSlot& j = s.joints[op.slot];
          shift(F, p, j.o);
          p = j.o;
          j.F = F;
          break;
        }
        case OpKind::spring: {
          StiffSlot& k = s.stiff[op.slot];
          shift(F, p, k.p);
          p = k.p;
          k.F = F;
          break;
        }
        case OpKind::block:
          block_wrenches(op, F, p);
          break;
        case OpKind::load: {
          JointSlot& j = s.joints[op.slot];
          shift(F, p, j.o);
          p = j.o;
          const V3 w = splat(op.mass) * gravity;
          F.a = F.a + w;
          F.b = F.b + cross(j.w, w);
          j.F = F;
          break;
        }
      }
    }
  }

  /// The first branch carries what the others leave.
  void block_wrenches(const Op& op, V6& F, V3& p) {
    StiffSlot& k = s.stiff[op.slot];
    shift(F, p, k.p);
    k.F = F;
    p = k.start.p;
    BranchSlot& first = s.branches[op.first];
    first.F = F;
    V6 start{};
    for (int b = op.count - 1; b >= 0; --b) {
      BranchSlot& branch = s.branches[op.first + b];
      if (b > 0) first.F = first.F - branch.F;
      V6 Fb = branch.F;
      V3 pb = branch.end.p;
      wrenches(P.chains[op.first + b], Fb, pb);
      shift(Fb, pb, p);
      start = start + Fb;
    }
    F = start;
  }

  // ---- tangents -------------------------------------------------------------------------------
  struct Tangent {
    bool rigid = true;
    Sym6 K;
    V6 c;
    V3 p;
    int prefix[16];
    int prefixed = 0;
  };

  void guard(V pivot, double unit) {
    const V relative = pivot * (1 / (scale[0] * scale[0] * unit * unit));
    lowest = lowest < relative ? lowest : relative;
  }

  /// Moves the tangent to point q; F is the wrench transmitted there.
  static void move(Tangent& t, const V3& q, const V6& F) {
    transport(t.K, t.c, q - t.p, F.a);
    t.p = q;
  }

  /// Rank-one step of a coordinate with row u = K J + g, own stiffness d (F4).
  void eliminate(const Op& op, JointSlot& j, V d, Tangent& t) {
    const int q = op.coordinate;
    const V da = s.da[q];
    const V pivot = da * d + s.dtau[q];
    guard(pivot, P.coordinates[q].unit);
    j.inverse = 1.0 / pivot;
    const V rho = s.tau[q] - dot(j.w, op.kind == OpKind::prismatic ? j.F.a : j.F.b);
    j.y = (dot(j.J, t.c) - rho) * j.inverse;
    downdate(t.K, j.u, da * j.inverse);
    t.c = t.c - (da * j.y) * j.u;
  }

  void append_joint(const Op& op, Tangent& t) {
    JointSlot& j = s.joints[op.slot];
    if (!op.eliminated) return;
    if (t.rigid) {
      t.prefix[t.prefixed++] = static_cast<int>(&op - P.ops);
      return;
    }
    move(t, j.o, j.F);
    V6 g{};
    if (op.kind == OpKind::prismatic) {
      j.J = {j.w, V3{}};
      g.b = cross(j.w, j.F.a);
    } else {
      j.J = {V3{}, j.w};
      g.b = splat(0.5) * cross(j.w, j.F.b);
    }
    const V6 KJ = t.K * j.J;
    j.u = KJ + g;
    eliminate(op, j, dot(j.J, KJ), t);
  }

  /// A joint before the first compliance of a chain whose start is held (F6); F at t.p.
  void prepend_joint(const Op& op, const V6& F, Tangent& t) {
    JointSlot& j = s.joints[op.slot];
    V6 g{};
    V d{};
    if (op.kind == OpKind::prismatic) {
      j.J = {j.w, V3{}};
    } else {
      j.J = {cross(j.w, t.p - j.o), j.w};
      g = {cross(F.a, j.w), splat(-0.5) * cross(j.w, F.b)};
      d = dot(F.a, cross(j.w, j.J.a));
    }
    const V6 KJ = t.K * j.J;
    j.u = KJ + g;
    eliminate(op, j, dot(j.J, KJ) + d, t);
  }

  /// Wrench at k.p with which a spring holds its end.
  V6 spring_wrench(const Op& op, const StiffSlot& k) const {
    const V* x = s.x + op.coordinate;
    V d[6], tau[6];
    for (int i = 0; i < 6; ++i) {
      d[i] = x[i] - op.rest[i];
      tau[i] = P.coordinates[op.coordinate + i].law >= 0 ? s.tau[op.coordinate + i] : splat(0);
    }
    for (int i = 0; i < 6; ++i)
      for (int q = 0; q < 6; ++q)
        if (op.K[6 * i + q] != 0) tau[i] += op.K[6 * i + q] * d[q];
    return {k.start.R * V3{tau[0], tau[1], tau[2]}, k.Z * V3{tau[3], tau[4], tau[5]}};
  }

  /// Relative tangent K, c at k.p of a spring, its start held (F5).
  void spring_tangent(const Op& op, const StiffSlot& k, Sym6& K, V6& c) {
    V diagonal[6];
    for (int i = 0; i < 6; ++i) {
      diagonal[i] = splat(op.K[7 * i]);
      if (P.coordinates[op.coordinate + i].law >= 0) diagonal[i] += s.dtau[op.coordinate + i];
    }
    const M3& R = k.start.R;
    const M3& Z = k.Z;
    K = Sym6{};
    add_pairs(K.A, R, diagonal, op.K, 0, 0, V3{});
    // The moment turns with the axes in sequence: H_ij = m·(w_i x w_j)/2 for i < j. Z is dual to the
    // axes w, and w_1 is both.
    const V3 w0 = R.c[0], w1 = Z.c[1], n = cross(Z.c[0], Z.c[1]);
    const V3 w2 = (1.0 / dot(n, Z.c[2])) * n;
    const V3 m = k.F.b;
    const V3 h{-0.5 * dot(m, cross(w0, w1)), -0.5 * dot(m, cross(w0, w2)), -0.5 * dot(m, cross(w1, w2))};
    add_pairs(K.E, Z, diagonal + 3, op.K, 3, 3, h);
    for (int i = 0; i < 3; ++i)
      for (int q = 0; q < 3; ++q) {
        const double v = op.K[6 * i + 3 + q];
        if (v == 0) continue;
        const V3 f = splat(v) * R.c[i];
        K.B.c[0] = K.B.c[0] + Z.c[q].x * f;
        K.B.c[1] = K.B.c[1] + Z.c[q].y * f;
        K.B.c[2] = K.B.c[2] + Z.c[q].z * f;
      }
    c = spring_wrench(op, k) - k.F;
  }

  /// S += sum_ij k_ij c_i c_j^T for a symmetric k, zero entries skipped; h adds to (01), (02), (12).
  static void add_pairs(S3& S, const M3& C, const V* diagonal, const double* k, int row, int column, const V3& h) {
    for (int i = 0; i < 3; ++i) {
      const V3 a = diagonal[i] * C.c[i];
      add_outer(S, a, C.c[i]);
    }
    const bool turning = row == 3;
    for (int i = 0; i < 3; ++i)
      for (int q = i + 1; q < 3; ++q) {
        const double v = k[6 * (row + i) + column + q];
        if (v == 0 && !turning) continue;
        V e = splat(v);
        if (turning) e += i + q == 1 ? h.x : i + q == 2 ? h.y : h.z;
        const V3 a = e * C.c[i], b = e * C.c[q];
        add_outer(S, a, C.c[q]);
        add_outer(S, b, C.c[i]);
      }
  }
  static void add_outer(S3& S, const V3& a, const V3& b) {
    S.xx += a.x * b.x;
    S.yy += a.y * b.y;
    S.zz += a.z * b.z;
    S.xy += a.x * b.y;
    S.xz += a.x * b.z;
    S.yz += a.y * b.z;
  }

  /// Relative tangent of a block: sum over its branches, closed to its first one (F8).
  void block_tangent(const Op& op, Sym6& K, V6& c) {
    for (int b = 0; b < op.count; ++b) {
      BranchSlot& branch = s.branches[op.first + b];
      tangent(P.chains[op.first + b], branch.F, branch.end.p, branch.K, branch.c);
      if (b == 0) {
        branch.error = V6{};
        K = branch.K;
        c = branch.c;
        continue;
      }
      branch.error = frame_error(branch.end, s.branches[op.first].end);
      K = K + branch.K;
      c = c + branch.c + dead(branch.K, branch.F.b, branch.error);
    }
  }

  /// A spring or block behind what came before: its relative twist is eliminated (F7).
  void append_stiff(const Op& op, Tangent& t) {
    StiffSlot& k = s.stiff[op.slot];
    Sym6 Ke;
    V6 ce;
    if (op.kind == OpKind::spring) spring_tangent(op, k, Ke, ce);
    else block_tangent(op, Ke, ce);
    if (t.rigid) {
      t.rigid = false;
      t.K = Ke;
      t.c = ce;
      t.p = k.p;
      for (int i = t.prefixed - 1; i >= 0; --i) prepend_joint(P.ops[t.prefix[i]], k.F, t);
      return;
    }
    move(t, k.p, k.F);
    const V3 f = k.F.a, m = k.F.b;
    Sym6 D = t.K + Ke;  // + [0, S(f); -S(f), 0]
    D.B.c[0] = D.B.c[0] + V3{splat(0), f.z, -f.y};
    D.B.c[1] = D.B.c[1] + V3{-f.z, splat(0), f.x};
    D.B.c[2] = D.B.c[2] + V3{f.y, -f.x, splat(0)};
    unpack(D, k.L);
    ldlt(k.L, k.inverse, lowest, scale);
    // X = V^T = K + [0, S(f); 0, S(m)/2], then X := L^-1 X.
    unpack(t.K, k.X);
    k.X[0][4] -= f.z;
    k.X[0][5] += f.y;
    k.X[1][3] += f.z;
    k.X[1][5] -= f.x;
    k.X[2][3] -= f.y;
    k.X[2][4] += f.x;
    const V3 h = splat(0.5) * m;
    k.X[3][4] -= h.z;
    k.X[3][5] += h.y;
    k.X[4][3] += h.z;
    k.X[4][5] -= h.x;
    k.X[5][3] -= h.y;
    k.X[5][4] += h.x;
    put(t.c - ce, k.y);
    for (int i = 1; i < 6; ++i)
      for (int q = 0; q < i; ++q) {
        for (int col = 0; col < 6; ++col) k.X[i][col] -= k.L[i][q] * k.X[q][col];
        k.y[i] -= k.L[i][q] * k.y[q];
      }
    V full[6];
    V row[6][6];
    for (int i = 0; i < 6; ++i)
      for (int col = 0; col < 6; ++col) row[i][col] = k.inverse[i] * k.X[i][col];
    const auto product = [&](int a, int b) {
      V sum = row[0][a] * k.X[0][b];
      for (int i = 1; i < 6; ++i) sum += row[i][a] * k.X[i][b];
      return sum;
    };
    t.K.A.xx -= product(0, 0);
    t.K.A.yy -= product(1, 1);
    t.K.A.zz -= product(2, 2);
    t.K.A.xy -= product(0, 1);
    t.K.A.xz -= product(0, 2);
    t.K.A.yz -= product(1, 2);
    for (int q = 0; q < 3; ++q) {
      t.K.B.c[q].x -= product(0, 3 + q);
      t.K.B.c[q].y -= product(1, 3 + q);
      t.K.B.c[q].z -= product(2, 3 + q);
    }
    t.K.E.xx -= product(3, 3);
    t.K.E.yy -= product(4, 4);
    t.K.E.zz -= product(5, 5);
    t.K.E.xy -= product(3, 4);
    t.K.E.xz -= product(3, 5);
    t.K.E.yz -= product(4, 5);
    for (int col = 0; col < 6; ++col) {
      full[col] = row[0][col] * k.y[0];
      for (int i = 1; i < 6; ++i) full[col] += row[i][col] * k.y[i];
    }
    t.c = t.c - get(full);
  }

  /// A body's weight: transmitted wrench and lever arm change (F9).
  void append_load(const Op& op, Tangent& t) {
    if (t.rigid) return;
    const JointSlot& j = s.joints[op.slot];
    move(t, j.o, j.F);
    add_lever(t.K.E, splat(-op.mass), gravity, j.w);
  }

  /// Tangent of a chain at point `end` under the end wrench F, its start held.
  void tangent(const ChainProgram& chain, const V6& F, const V3& end, Sym6& K, V6& c) {
    Tangent t;
    for (int i = chain.first; i < chain.first + chain.count; ++i) {
      const Op& op = P.ops[i];
      switch (op.kind) {
        case OpKind::revolute:
        case OpKind::prismatic:
          append_joint(op, t);
          break;
        case OpKind::spring:
        case OpKind::block:
          append_stiff(op, t);
          break;
        case OpKind::load:
          append_load(op, t);
          break;
      }
    }
    move(t, end, F);
    K = t.K;
    c = t.c;
  }

  // ---- residual of a perturbed program with the factors of the last tangent (F10) -------------
  void joint_residual(const Op& op, V6& c) {
    const JointSlot& j = s.joints[op.slot];
    const int q = op.coordinate;
    const V rho = s.tau[q] - dot(j.w, op.kind == OpKind::prismatic ? j.F.a : j.F.b);
    c = c - (s.da[q] * ((dot(j.J, c) - rho) * j.inverse)) * j.u;
  }

  V6 stiff_residual(const Op& op) {
    const StiffSlot& k = s.stiff[op.slot];
    if (op.kind == OpKind::spring) return spring_wrench(op, k) - k.F;
    V6 sum{};
    for (int b = 0; b < op.count; ++b) {
      BranchSlot& branch = s.branches[op.first + b];
      V6 c = residual(P.chains[op.first + b], branch.end.p);
      if (b > 0) c = c + dead(branch.K, branch.F.b, frame_error(branch.end, s.branches[op.first].end));
      sum = sum + c;
    }
    return sum;
  }

  static void series_residual(const StiffSlot& k, const V6& inner, V6& c) {
    V y[6];
    put(c - inner, y);
    for (int i = 1; i < 6; ++i)
      for (int q = 0; q < i; ++q) y[i] -= k.L[i][q] * y[q];
    V sum[6];
    for (int col = 0; col < 6; ++col) sum[col] = splat(0);
    for (int i = 0; i < 6; ++i) {
      const V d = k.inverse[i] * y[i];
      for (int col = 0; col < 6; ++col) sum[col] += k.X[i][col] * d;
    }
    c = c - get(sum);
  }

  /// Out-of-balance wrench at the end of a chain, at the frames and wrenches of the last passes.
  V6 residual(const ChainProgram& chain, const V3& end) {
    V6 c{};
    V3 p{};
    const auto move_to = [&](const V3& to) {
      c.b = c.b - cross(to - p, c.a);
      p = to;
    };
    for (int i = chain.first_stiff; i < chain.first + chain.count; ++i) {
      const Op& op = P.ops[i];
      if (op.kind == OpKind::load || (op.kind <= OpKind::prismatic && !op.eliminated)) continue;
      if (op.kind <= OpKind::prismatic) {
        move_to(s.joints[op.slot].o);
        joint_residual(op, c);
      } else if (i > chain.first_stiff) {
        const StiffSlot& k = s.stiff[op.slot];
        move_to(k.p);
        series_residual(k, stiff_residual(op), c);
      } else {
        c = stiff_residual(op);
        p = s.stiff[op.slot].p;
        for (int q = i - 1; q >= chain.first; --q)
          if (P.ops[q].kind <= OpKind::prismatic && P.ops[q].eliminated) joint_residual(P.ops[q], c);
      }
    }
    move_to(end);
    return c;
  }

  // ---- steps ----------------------------------------------------------------------------------
  /// Step of a joint from the twist behind it; leaves the twist before it.
  void joint_step(const Op& op, V6& eta) {
    const JointSlot& j = s.joints[op.slot];
    const int q = op.coordinate;
    const V dz = dot(j.u, eta) * j.inverse + j.y;
    s.dz[q] = dz;
    eta = eta - (s.da[q] * dz) * j.J;
  }

  static void move_twist(V6& eta, const V3& from, const V3& to) { eta.a = eta.a + cross(eta.b, to - from); }

  /// Relative twist of a spring or block from the twist behind it.
  static V6 relative_twist(const StiffSlot& k, const V6& eta) {
    V e[6], z[6];
    put(eta, e);
    for (int i = 0; i < 6; ++i) {
      V sum = k.y[i];
      for (int col = 0; col < 6; ++col) sum += k.X[i][col] * e[col];
      z[i] = k.inverse[i] * sum;
    }
    for (int i = 4; i >= 0; --i)
      for (int q = i + 1; q < 6; ++q) z[i] -= k.L[q][i] * z[q];
    return get(z);
  }

  /// Steps inside a spring or block; `turn` is the rotation of its start frame.
  void stiff_step(const Op& op, const V6& zeta, const V3& turn, M active) {
    const StiffSlot& k = s.stiff[op.slot];
    if (op.kind == OpKind::spring) {
      V* dz = s.dz + op.coordinate;
      const V3 t = k.start.R % zeta.a, r = k.Z % zeta.b;
      dz[0] = t.x;
      dz[1] = t.y;
      dz[2] = t.z;
      dz[3] = r.x;
      dz[4] = r.y;
      dz[5] = r.z;
      return;
    }
    for (int b = 0; b < op.count; ++b) {
      BranchSlot& branch = s.branches[op.first + b];
      const V6 own = zeta + branch.error;
      if (b > 0) {
        const V6 step =
            dead(branch.K, branch.F.b, own) + branch.c + V6{cross(turn, branch.F.a), cross(turn, branch.F.b)};
        branch.F = {select(active, branch.F.a + step.a, branch.F.a), select(active, branch.F.b + step.b, branch.F.b)};
        const V force = larger(larger(absolute(step.a.x), absolute(step.a.y)), absolute(step.a.z));
        const V moment = larger(larger(absolute(step.b.x), absolute(step.b.y)), absolute(step.b.z));
        transferred = larger(transferred, larger(force * (1 / scale[0]), moment * (1 / scale[3])) * (1 / scale[3]));
      }
      back(P.chains[op.first + b], own, branch.end.p, turn, active);
    }
  }

  /// Steps of all coordinates of a chain from the twist of its end relative to its start.
  void back(const ChainProgram& chain, V6 eta, V3 p, const V3& turn, M active) {
    for (int i = chain.first + chain.count - 1; i > chain.first_stiff; --i) {
      const Op& op = P.ops[i];
      if (op.kind == OpKind::load || (op.kind <= OpKind::prismatic && !op.eliminated)) continue;
      if (op.kind <= OpKind::prismatic) {
        move_twist(eta, p, s.joints[op.slot].o);
        p = s.joints[op.slot].o;
        joint_step(op, eta);
        continue;
      }
      const StiffSlot& k = s.stiff[op.slot];
      move_twist(eta, p, k.p);
      const V6 zeta = relative_twist(k, eta);
      eta = eta - zeta;
      p = k.p;
      stiff_step(op, zeta, turn + eta.b, active);
    }
    const Op& op = P.ops[chain.first_stiff];
    const StiffSlot& k = s.stiff[op.slot];
    move_twist(eta, p, k.p);
    const V3 whole = eta.b;
    for (int i = chain.first; i < chain.first_stiff; ++i)
      if (P.ops[i].kind <= OpKind::prismatic && P.ops[i].eliminated) joint_step(P.ops[i], eta);
    stiff_step(op, eta, turn + whole - eta.b, active);
  }
};

}  // namespace stiffmap::kernel
