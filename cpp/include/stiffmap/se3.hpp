// SPDX-License-Identifier: MIT
// Rotations and rigid transforms: exponential, logarithm, adjoints and their derivatives.
// Equation numbers are those of docs/theory.md, section "Rigid motion".
#pragma once

#include "stiffmap/types.hpp"

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

/// Rotation by the rotation vector phi (theory R1). With `J_left`: d exp = skew(J_left dphi) exp.
Mat3 exp_so3(const Vec3& phi, Mat3* J_left = nullptr);

/// Rotation vector of R, norm at most pi (theory R2).
Vec3 log_so3(const Mat3& R);

/// Left Jacobian of SO(3) (theory R3) and its inverse (theory R4).
Mat3 left_jacobian_so3(const Vec3& phi);
Mat3 left_jacobian_inverse_so3(const Vec3& phi);

/// Derivative of left_jacobian_so3(phi) v with respect to phi (theory R5).
Mat3 left_jacobian_derivative_so3(const Vec3& phi, const Vec3& v);

/// Exponential of the twist xi = (rho, phi) (theory R6) and its inverse (theory R7).
Pose exp_se3(const Vec6& xi);
Vec6 log_se3(const Pose& T);

/// Maps a twist in frame b to frame a, reference points at the frame origins (theory R8).
Mat6 adjoint(const Pose& T_ab);

/// Lie bracket as a matrix: d/ds adjoint(exp(s xi)) at s = 0 (theory R9).
Mat6 adjoint_small(const Vec6& xi);

/// Left Jacobian of SE(3) (theory R10).
Mat6 left_jacobian_se3(const Vec6& xi);

/// Rotation by `angle` about the unit vector `axis`.
Mat3 rotation_about(const Vec3& axis, double angle);

}  // namespace stiffmap
