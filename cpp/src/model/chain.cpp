// SPDX-License-Identifier: MIT
#include "stiffmap/model/chain.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stiffmap {
namespace {

/// Straight between the knots, level beyond them.
double between(const std::vector<std::pair<double, double>>& knots, double u) {
  if (knots.empty()) return 0;
  const auto after =
      std::lower_bound(knots.begin(), knots.end(), u, [](const auto& knot, double x) { return knot.first < x; });
  if (after == knots.begin()) return knots.front().second;
  if (after == knots.end()) return knots.back().second;
  const auto& [u0, e0] = *(after - 1);
  const auto& [u1, e1] = *after;
  return e0 + (u - u0) / (u1 - u0) * (e1 - e0);
}

}  // namespace

double CommandError::operator()(double u) const {
  return offset + slope * (u - reference) +
         amplitude * std::sin(2 * std::numbers::pi * (u - reference) / period + phase) + between(knots, u);
}

}  // namespace stiffmap
