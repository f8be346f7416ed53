// SPDX-License-Identifier: MIT
// The links of test and benchmark machines.
#pragma once

#include "stiffmap/algebra/types.hpp"

namespace stiffmap::test {

/// Rigidities of a straight prismatic beam along local x (SI).
struct BeamSection {
  double EA, EIy, EIz, GJ;
};

/// Compliance of the free end of an Euler-Bernoulli cantilever along x (theory S1).
inline Mat6 beam_compliance(double L, const BeamSection& b) {
  Mat6 C = Mat6::Zero();
  C(0, 0) = L / b.EA;
  C(1, 1) = L * L * L / (3 * b.EIz);
  C(2, 2) = L * L * L / (3 * b.EIy);
  C(3, 3) = L / b.GJ;
  C(4, 4) = L / b.EIy;
  C(5, 5) = L / b.EIz;
  C(1, 5) = C(5, 1) = L * L / (2 * b.EIz);
  C(2, 4) = C(4, 2) = -L * L / (2 * b.EIy);
  return C;
}

}  // namespace stiffmap::test
