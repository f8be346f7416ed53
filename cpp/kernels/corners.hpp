// SPDX-License-Identifier: MIT
// Steps across corners of laws: by deflections, as far as the energy falls (docs/fast_path.md F19).
#pragma once

#include "laws.hpp"

namespace stiffmap::kernel {

struct Corners {
  const Program& P;
  Scratch& s;

  /// Share of the last step, at most the whole one, after which the energy hardly falls any further along it: the root
  /// of its derivative, which rises with the share as the laws' forces do. Where the tangent's share leaves little of
  /// it the whole step is as good.
  [[gnu::noinline]] V share() const {
    const V work = decrement();
    V low = splat(0), high = splat(1), at_low = -work, at_high = slope(high, work);
    const M far = (at_high > most_left * work) & (work > 0.0);
    V out = splat(1);
    for (int k = 0; k < trials && any(far); ++k) {
      // Illinois: a false position that does not stay on one side.
      out = select(far, low - at_low * (high - low) / (at_high - at_low), splat(1));
      const V here = slope(out, work);
      const M above = here > 0.0;
      at_low = select(above, 0.5 * at_low, here);
      at_high = select(above, here, 0.5 * at_high);
      low = select(above, low, out);
      high = select(above, out, high);
    }
    return out;
  }

  /// Takes a share of the last step: deflections by what the tangent says, forces as the laws have them there, so that
  /// loops that the step closes stay closed.
  [[gnu::noinline]] void move(M lanes, V share) const {
    for (int q = 0; q < P.coordinate_count; ++q) {
      V z = s.z[q] + share * s.dz[q];
      if (bends(q)) {
        const V a = s.x[q] - s.a_base[q] + share * s.da[q] * s.dz[q];
        z = from_deflection(P, law(q), s.linear[q], a);
      }
      s.z[q] = select(lanes, z, s.z[q]);
    }
  }

 private:
  static constexpr double most_left = 0.1;
  static constexpr int trials = 5;

  const LawProgram& law(int q) const { return P.laws[P.coordinates[q].law]; }
  bool bends(int q) const {
    const CoordinateProgram& k = P.coordinates[q];
    return k.law >= 0 && !k.locked && P.laws[k.law].count > 0;
  }

  /// Work of the last step against the tangent's springs: what its first-order change of energy is, but for the sign.
  V decrement() const {
    V sum = splat(0);
    for (int q = 0; q < P.coordinate_count; ++q) {
      const CoordinateProgram& k = P.coordinates[q];
      if (!k.locked && (k.law >= 0 || k.stiffness > 0)) sum += s.da[q] * s.dtau[q] * s.dz[q] * s.dz[q];
    }
    for (int i = 0; i < P.op_count; ++i) {
      const Op& op = P.ops[i];
      if (op.kind != OpKind::spring) continue;
      const V* d = s.dz + op.coordinate;
      for (int r = 0; r < 6; ++r)
        for (int c = 0; c < 6; ++c)
          if (op.K[6 * r + c] != 0) sum += op.K[6 * r + c] * d[r] * d[c];
    }
    return sum;
  }

  /// Derivative of the energy by the share, from -work.
  V slope(V share, V work) const {
    V out = (share - 1.0) * work;
    for (int q = 0; q < P.coordinate_count; ++q) {
      if (!bends(q)) continue;
      const V a = s.x[q] - s.a_base[q], way = s.da[q] * s.dz[q];
      const V more = force_at(P, law(q), s.linear[q], a + share * way) - force_at(P, law(q), s.linear[q], a);
      out += (more - share * s.dtau[q] * s.dz[q]) * way;
    }
    return out;
  }
};

}  // namespace stiffmap::kernel
