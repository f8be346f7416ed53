// SPDX-License-Identifier: MIT
// Rotations and rigid transforms: exponential and logarithm.
// Equation numbers are those of docs/theory.md, section "Rigid motion".
#pragma once

#include "stiffmap/algebra/types.hpp"

namespace stiffmap {

/// Cross-product matrix: skew(a) b = a x b.
inline Mat3 skew(const Vec3& a) {
  Mat3 s;
  s << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return s;
}

/// Frame b in frame a: p_a = p + R p_b.
struct Pose {
  Vec3 p = Vec3::Zero();
  Mat3 R = Mat3::Identity();

  Pose operator*(const Pose& b) const { return {p + R * b.p, R * b.R}; }
  Vec3 operator*(const Vec3& b) const { return p + R * b; }
  Pose inverse() const { return {-(R.transpose() * p), R.transpose()}; }
};

/// How far two poses are apart; a turn counts as the chord of its arc at the length.
inline double distance(const Pose& a, const Pose& b, double length) {
  return std::hypot((a.p - b.p).norm(), std::sqrt(0.5) * length * (a.R - b.R).norm());
}

/// Rotation by the rotation vector phi (theory R1).
Mat3 exp_so3(const Vec3& phi);

/// Rotation vector of R, norm at most pi (theory R2).
Vec3 log_so3(const Mat3& R);

/// Rotation by `angle` about the unit vector `axis`.
Mat3 rotation_about(const Vec3& axis, double angle);

}  // namespace stiffmap
