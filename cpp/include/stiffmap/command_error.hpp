// SPDX-License-Identifier: MIT
// What a drive makes of its command: theory G1.
#pragma once

#include <utility>
#include <vector>

namespace stiffmap {

/// Error of a commanded coordinate u, theory (G1): offset + slope (u - reference)
/// + amplitude sin(2 pi (u - reference) / period + phase) + what `knots` say at u: (coordinate, error) by rising
/// coordinate, straight between them and level beyond the ends.
struct CommandError {
  double offset = 0, slope = 0, amplitude = 0, period = 1, phase = 0, reference = 0;
  std::vector<std::pair<double, double>> knots;

  double operator()(double u) const;
};

}  // namespace stiffmap
