// SPDX-License-Identifier: MIT
#include "stiffmap/model/law.hpp"

#include <algorithm>
#include <cmath>

#include "stiffmap/common/check.hpp"

namespace stiffmap {
namespace {

/// a of a + bend a^3 = y.
double unbent(double y, double bend) {
  if (bend == 0) return y;
  const double s = std::sqrt(3 * bend);
  return 2 / s * std::sinh(std::asinh(1.5 * s * y) / 3);
}

}  // namespace

Law::Law(double stiffness, double cubic, std::vector<std::pair<double, double>> knots, double friction)
    : stiffness_(stiffness), cubic_(cubic), friction_(friction), knots_(std::move(knots)) {
  require(std::isfinite(stiffness) && stiffness > 0, "law.stiffness", "a positive finite number", stiffness);
  require(cubic >= 0, "law.cubic", "a number >= 0", cubic);
  require(std::isfinite(friction) && friction >= 0, "law.friction", "a finite number >= 0", friction);
  require(knots_.empty() || cubic == 0, "law", "either knots or a cubic term", "both");
  require(knots_.size() != 1, "law.knots", "two or more points", knots_.size());
  for (std::size_t i = 0; i < knots_.size(); ++i) {
    if (i) {
      const double da = knots_[i].first - knots_[i - 1].first, dt = knots_[i].second - knots_[i - 1].second;
      require(da >= 0 && dt >= 0 && da + dt > 0, "law.knots", "points that rise in deflection and force", i);
    }
    z_.push_back(knots_[i].first + knots_[i].second / stiffness_);
  }
}

bool Law::sticks() const {
  return std::adjacent_find(knots_.begin(), knots_.end(),
                            [](const auto& a, const auto& b) { return a.first == b.first; }) != knots_.end();
}

LawPoint Law::at(double z, double scale) const {
  const double k = stiffness_ / scale;
  if (knots_.empty()) {
    const double a = unbent(z, 0.5 * cubic_ / k), da = 1 / (1 + 1.5 * cubic_ / k * a * a);
    return {a, k * a + cubic_ * a * a * a, da, (k + 3 * cubic_ * a * a) * da};
  }
  // A knot's z does not move with `scale`: only the slope beyond the ends does, theory (L2).
  const std::size_t n = z_.size();
  if (z <= z_.front() || z >= z_.back()) {
    const std::size_t end = z <= z_.front() ? 0 : n - 1;
    const double d = z - z_[end], da = scale / (1 + scale);  // a' + tau'/stiffness = 1, tau' = k a'
    return {knots_[end].first + da * d, knots_[end].second + k * da * d, da, k * da};
  }
  const std::size_t i = static_cast<std::size_t>(std::upper_bound(z_.begin(), z_.end(), z) - z_.begin());
  const double width = z_[i] - z_[i - 1], s = (z - z_[i - 1]) / width;
  const double Da = knots_[i].first - knots_[i - 1].first, Dt = knots_[i].second - knots_[i - 1].second;
  return {knots_[i - 1].first + s * Da, knots_[i - 1].second + s * Dt, Da / width, Dt / width};
}

double Law::from_force(double tau, double scale) const {
  const double k = stiffness_ / scale;
  if (knots_.empty()) return 0.5 * (unbent(tau / k, cubic_ / k) + tau / k);
  if (tau < knots_.front().second) {
    const double a = knots_.front().first + (tau - knots_.front().second) / k;
    return z_.front() + (a - knots_.front().first) + (tau - knots_.front().second) / stiffness_;
  }
  if (tau > knots_.back().second) {
    const double a = knots_.back().first + (tau - knots_.back().second) / k;
    return z_.back() + (a - knots_.back().first) + (tau - knots_.back().second) / stiffness_;
  }
  // First and last point at this force; their middle where a gap makes it a whole interval.
  double lo = z_.front(), hi = z_.back();
  for (std::size_t i = 1; i < z_.size(); ++i) {
    const double t0 = knots_[i - 1].second, t1 = knots_[i].second;
    if (t1 < tau) lo = z_[i];
    else if (t1 > t0 && t0 < tau) lo = z_[i - 1] + (tau - t0) / (t1 - t0) * (z_[i] - z_[i - 1]);
  }
  for (std::size_t i = z_.size(); i-- > 1;) {
    const double t0 = knots_[i - 1].second, t1 = knots_[i].second;
    if (t0 > tau) hi = z_[i - 1];
    else if (t1 > t0 && t1 > tau) hi = z_[i - 1] + (tau - t0) / (t1 - t0) * (z_[i] - z_[i - 1]);
  }
  return 0.5 * (lo + hi);
}

double Law::from_deflection(double a, double scale) const {
  if (knots_.empty()) return a + 0.5 * cubic_ * scale / stiffness_ * a * a * a;
  const std::size_t n = knots_.size();
  if (a <= knots_.front().first || a >= knots_.back().first) {
    const std::size_t end = a <= knots_.front().first ? 0 : n - 1;
    return z_[end] + (a - knots_[end].first) * (1 + scale) / scale;
  }
  std::size_t i = 1;
  while (knots_[i].first <= a) ++i;
  return z_[i - 1] + (a - knots_[i - 1].first) / (knots_[i].first - knots_[i - 1].first) * (z_[i] - z_[i - 1]);
}

}  // namespace stiffmap
