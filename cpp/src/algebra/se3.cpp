// SPDX-License-Identifier: MIT
#include "stiffmap/algebra/se3.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double series_angle = 1e-3;  // below, four terms of each series are exact to round-off

/// sin(t)/t and (1-cos t)/t^2.
struct Coefficients {
  double a, b;
};

Coefficients coefficients(double t) {
  const double t2 = t * t;
  if (t < series_angle) return {1 - t2 / 6 * (1 - t2 / 20), 0.5 - t2 / 24 * (1 - t2 / 30)};
  const double half = std::sin(0.5 * t);
  return {std::sin(t) / t, 2 * half * half / t2};
}

}  // namespace

Mat3 exp_so3(const Vec3& phi) {
  const Coefficients k = coefficients(phi.norm());
  const Mat3 S = skew(phi), S2 = S * S;
  return Mat3::Identity() + k.a * S + k.b * S2;
}

Vec3 log_so3(const Mat3& R) {
  Eigen::Quaterniond q(R);  // its branches keep all digits near pi as well
  if (q.w() < 0) q.coeffs() *= -1;
  const double n = q.vec().norm();
  const double angle = 2 * std::atan2(n, q.w());
  return n < 1e-12 ? Vec3(2 * q.vec()) : Vec3(angle / n * q.vec());
}

Mat3 rotation_about(const Vec3& u, double angle) {
  const double s = std::sin(angle), h = std::sin(0.5 * angle);
  const Mat3 S = skew(u);
  return Mat3::Identity() + s * S + (2 * h * h) * (S * S);
}

}  // namespace stiffmap
