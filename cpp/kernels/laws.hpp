// SPDX-License-Identifier: MIT
// Laws of joints, drives and single spring directions: deflection, force and slopes at the parameter of each, and where
// they start (theory L1-L3).
#pragma once

#include "slots.hpp"

namespace stiffmap::kernel {

/// Change of a hardening law's slope by the last step; 0 of another law.
inline V slope_change(const Program& P, const Scratch& s, int q) {
  const CoordinateProgram& k = P.coordinates[q];
  if (k.law < 0 || k.locked || !(P.laws[k.law].cubic > 0)) return splat(0);
  return 6 * P.laws[k.law].cubic * (s.x[q] - s.a_base[q]) * s.da[q] * s.dz[q];
}

/// Force at deflection a of a law with corners, without dry friction; k: its own slope beyond the ends.
inline V force_at(const Program& P, const LawProgram& law, V k, V a) {
  const double* n = P.knots + 3 * law.first;
  const double* last = n + 3 * (law.count - 1);
  V out = select(a < n[0], n[1] + k * (a - n[0]), last[1] + k * (a - last[0]));
  for (int i = 1; i < law.count; ++i) {
    const double *u = n + 3 * (i - 1), *v = u + 3;
    const double rate = (v[1] - u[1]) / (v[0] - u[0]);
    out = select((a >= u[0]) & (a < v[0]), u[1] + rate * (a - u[0]), out);
  }
  return out;
}

/// Parameter of that point (theory L1).
inline V from_deflection(const Program& P, const LawProgram& law, V k, V a) {
  return a + force_at(P, law, k, a) * (1 / law.stiffness);
}

struct Laws {
  const Program& P;
  Scratch& s;

  /// All coordinates at their parameter; `secant`: at zero deflection, all laws linear.
  [[gnu::noinline]] void evaluate(bool secant) {
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      if (k.law < 0 || k.locked) {
        s.x[q] = s.a_base[q] + s.z[q];
        if (k.stiffness > 0) {
          s.tau[q] = k.stiffness * (s.x[q] - k.rest);
          s.dtau[q] = splat(k.stiffness);
        }
        if (k.friction != 0) s.tau[q] = k.friction * s.friction_sign[q];
        continue;
      }
      const LawProgram& law = P.laws[k.law];
      if (!secant) {
        put(law, q);
        continue;
      }
      s.x[q] = s.a_base[q];
      s.tau[q] = splat(0);
      s.da[q] = splat(1);
      s.dtau[q] = s.linear[q];
    }
  }

  /// As the reference: what bears nothing stays at its centre, a preload is borne besides, friction opposes the
  /// deflection.
  /// Returns the lanes in which it is doubtful whether something bears and that matters: round-off decides, and the
  /// reference's counts.
  [[gnu::noinline]] M start(M active) {
    M doubtful{};
    const auto sign = [](V x) { return select(x > 0.0, splat(1), select(x < 0.0, splat(-1), splat(0))); };
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      if (k.locked || (k.law < 0 && k.friction == 0)) continue;
      const V linear = s.z[q], share = absolute(linear) * k.unit / P.length;
      const M bears = share > unloaded;
      if (!(k.law >= 0 && strictly_rises(P.laws[k.law])))
        doubtful |= active & (share > unloaded / doubt) & (share < doubt * unloaded);
      if (k.law < 0) {
        s.friction_sign[q] = select(active, select(bears, sign(linear), splat(0)), s.friction_sign[q]);
        continue;
      }
      const LawProgram& law = P.laws[k.law];
      const V tau = select(bears, s.linear[q] * linear, splat(0)), side = sign(tau);
      const V spring = tau - law.friction * side;
      const V before = law.count > 0 ? point(law, s.linear[q], s.scale[q], splat(0)).tau : splat(0);
      V z = k.by_force ? spring / s.linear[q] : from_force(law, before + spring, s.linear[q]);
      if (P.bends && law.count > 0) {  // a cable that is slack has no place for that force: the deflection is the start
        const V far = absolute(point(law, s.linear[q], s.scale[q], z).a) * k.unit;
        z = select(far > slack * P.length, from_deflection(P, law, s.linear[q], linear), z);
      }
      s.friction_sign[q] = select(active, side, s.friction_sign[q]);
      s.z[q] = select(active, select(bears, z, splat(0)), s.z[q]);
    }
    return doubtful;
  }

  /// Lanes in which a drive or spring is inside its gap.
  M open_gaps() const {
    M open{};
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      if (k.law >= 0 && !k.locked && P.laws[k.law].count > 0) open |= s.dtau[q] == 0.0;
    }
    return open;
  }

  /// How much the last step changes the slope of a hardening law, relative: its answer's tangent is not that of before.
  [[gnu::noinline]] V hardening_change() const {
    V worst = splat(0);
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      if (k.law < 0 || k.locked || !(P.laws[k.law].cubic > 0)) continue;
      const LawProgram& law = P.laws[k.law];
      const V a = s.x[q] - s.a_base[q], slope = s.linear[q] + 3 * law.cubic * a * a;
      worst = larger(worst, absolute(slope_change(P, s, q) / slope));
    }
    return worst;
  }

  /// Share of the last step up to shortly behind the first corner of a law (Katzenelson 1965): piece by piece the way
  /// to the equilibrium is found where whole steps go to and fro.
  [[gnu::noinline]] V to_corner() const {
    V least = splat(1);
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      if (k.law < 0 || k.locked) continue;
      const LawProgram& law = P.laws[k.law];
      const V behind = 1e-10 * P.length / (k.unit * absolute(s.dz[q]));
      for (int i = 0; i < law.count; ++i) {
        const V share = (P.knots[3 * (law.first + i) + 2] - s.z[q]) / s.dz[q];
        least = select((share > 0.0) & (share + behind < least), share + behind, least);
      }
    }
    return least;
  }

 private:
  static constexpr double unloaded = 1e-11;
  static constexpr double slack = 0.02;  ///< deflection, of the length, that no gap has
  static constexpr double doubt = 1.5;   ///< factor about it; closures of the two paths differ by some 1e-14

  /// At the law's own parameter.
  void put(const LawProgram& law, int q) {
    const V k = s.linear[q], z = s.z[q];
    if (P.coordinates[q].by_force) {
      // k z = k a + c a^3: in a, Newton's steps on the stiff part shrink by a third only.
      const V u = cubic_root(s.curve[q] * z);
      s.tau[q] = k * z + law.friction * s.friction_sign[q];
      s.da[q] = 1.0 / (1.0 + 3 * u * u);
      s.dtau[q] = k;
      s.x[q] = s.a_base[q] + u / s.curve[q];
      return;
    }
    if (law.count == 0) {
      s.tau[q] = (k + law.cubic * z * z) * z + law.friction * s.friction_sign[q];
      s.da[q] = splat(1);
      s.dtau[q] = k + 3 * law.cubic * z * z;
      s.x[q] = s.a_base[q] + z;
      return;
    }
    const Point at = point(law, k, s.scale[q], z);
    s.tau[q] = at.tau + law.friction * s.friction_sign[q];
    s.da[q] = at.da;
    s.dtau[q] = at.dtau;
    s.x[q] = s.a_base[q] + at.a;
  }

  struct Point {
    V a, tau, da, dtau;
  };

  /// Of a law with corners, without dry friction.
  Point point(const LawProgram& law, V k, V scale, V z) const {
    const double* n = P.knots + 3 * law.first;
    const double* last = n + 3 * (law.count - 1);
    // Beyond the ends with the drive's own slope, then the pieces between.
    const V beyond = scale / (1.0 + scale);
    const M low = z <= n[2];
    const V a0 = select(low, splat(n[0]), splat(last[0])), t0 = select(low, splat(n[1]), splat(last[1]));
    const V z0 = select(low, splat(n[2]), splat(last[2]));
    V a = a0 + beyond * (z - z0), tau = t0 + k * beyond * (z - z0), da = beyond, dtau = k * beyond;
    for (int i = 1; i < law.count; ++i) {
      const double* u = n + 3 * (i - 1);
      const double width = u[5] - u[2];
      const M inside = (z > u[2]) & (z < u[5]);
      const M edge = (i > 1) ? (z == u[2]) : (z != z);
      const M here = inside | edge;
      const V share = (z - u[2]) * (1 / width);
      a = select(here, u[0] + share * (u[3] - u[0]), a);
      tau = select(here, u[1] + share * (u[4] - u[1]), tau);
      da = select(here, splat((u[3] - u[0]) / width), da);
      dtau = select(here, splat((u[4] - u[1]) / width), dtau);
    }
    return {a, tau, da, dtau};
  }

  /// Where the law carries the force that the linear start found: middle of a gap.
  V from_force(const LawProgram& law, V tau, V k) const {
    if (law.count == 0) {
      V a = tau / k;
      for (int i = 0; i < 60 && law.cubic > 0; ++i)
        a -= (k * a + law.cubic * a * a * a - tau) / (k + 3 * law.cubic * a * a);
      return a;
    }
    const double* n = P.knots + 3 * law.first;
    const double* last = n + 3 * (law.count - 1);
    V lo = splat(n[2]), hi = splat(last[2]);
    for (int i = 1; i < law.count; ++i) {
      const double *u = n + 3 * (i - 1), *v = u + 3;
      const V here = v[1] > u[1] ? u[2] + (tau - u[1]) / (v[1] - u[1]) * (v[2] - u[2]) : splat(u[2]);
      lo = select(tau > v[1], splat(v[2]), v[1] > u[1] ? select(tau > u[1], here, lo) : lo);
    }
    for (int i = law.count; i-- > 1;) {
      const double *u = n + 3 * (i - 1), *v = u + 3;
      const V here = v[1] > u[1] ? u[2] + (tau - u[1]) / (v[1] - u[1]) * (v[2] - u[2]) : splat(u[2]);
      hi = select(tau<u[1], splat(u[2]), v[1]> u[1] ? select(tau < v[1], here, hi) : hi);
    }
    const M low = tau<n[1], high = tau> last[1];
    const V over = tau - select(low, splat(n[1]), splat(last[1]));
    return select(low | high, select(low, splat(n[2]), splat(last[2])) + over / k + over / law.stiffness,
                  0.5 * (lo + hi));
  }

  /// Its equilibrium does not depend on where Newton starts: no dry friction, and it yields under any force.
  bool strictly_rises(const LawProgram& law) const {
    const double* n = P.knots + 3 * law.first;
    for (int i = 1; i < law.count; ++i)
      if (n[3 * i + 1] == n[3 * i - 2]) return false;
    return law.friction == 0;
  }
};

}  // namespace stiffmap::kernel
