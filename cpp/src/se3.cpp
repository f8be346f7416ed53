// SPDX-License-Identifier: MIT
#include "stiffmap/se3.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double series_angle = 1e-3;  // below, four terms of each series are exact to round-off

/// sin(t)/t, (1-cos t)/t^2, (t-sin t)/t^3 and the derivatives of the last two divided by t.
struct Coefficients {
  double a, b, c, db, dc;
};

Coefficients coefficients(double t) {
  const double t2 = t * t;
  if (t < series_angle) {
    return {1 - t2 / 6 * (1 - t2 / 20), 0.5 - t2 / 24 * (1 - t2 / 30), 1.0 / 6 - t2 / 120 * (1 - t2 / 42),
            -1.0 / 12 + t2 / 180, -1.0 / 60 + t2 / 1260};
  }
  const double s = std::sin(t), half = std::sin(0.5 * t);
  const double b = 2 * half * half / t2;
  const double c = t < 0.1 ? 1.0 / 6 - t2 / 120 * (1 - t2 / 42 * (1 - t2 / 72 * (1 - t2 / 110))) : (t - s) / (t2 * t);
  const double db =
      t < 0.1 ? -1.0 / 12 + t2 / 180 * (1 - t2 / 37.333333333333336 * (1 - t2 / 67.5)) : (s / t - 2 * b) / t2;
  const double dc = t < 0.1 ? -1.0 / 60 + t2 / 1260 * (1 - t2 / 48 * (1 - t2 / 82.5)) : (b - 3 * c) / t2;
  return {s / t, b, c, db, dc};
}

}  // namespace

Mat3 exp_so3(const Vec3& phi, Mat3* J_left) {
  const Coefficients k = coefficients(phi.norm());
  const Mat3 S = skew(phi), S2 = S * S;
  if (J_left) *J_left = Mat3::Identity() + k.b * S + k.c * S2;
  return Mat3::Identity() + k.a * S + k.b * S2;
}

Vec3 log_so3(const Mat3& R) {
  Eigen::Quaterniond q(R);  // its branches keep all digits near pi as well
  if (q.w() < 0) q.coeffs() *= -1;
  const double n = q.vec().norm();
  const double angle = 2 * std::atan2(n, q.w());
  return n < 1e-12 ? Vec3(2 * q.vec()) : Vec3(angle / n * q.vec());
}

Mat3 left_jacobian_so3(const Vec3& phi) {
  Mat3 J;
  exp_so3(phi, &J);
  return J;
}

Mat3 left_jacobian_inverse_so3(const Vec3& phi) {
  const double t = phi.norm(), t2 = t * t;
  const Mat3 S = skew(phi);
  const double d = t < 1e-2 ? 1.0 / 12 + t2 / 720 * (1 + t2 / 42) : (1 - 0.5 * t / std::tan(0.5 * t)) / t2;
  return Mat3::Identity() - 0.5 * S + d * S * S;
}

Mat3 left_jacobian_derivative_so3(const Vec3& phi, const Vec3& v) {
  const Coefficients k = coefficients(phi.norm());
  const Vec3 sv = phi.cross(v), ssv = phi.cross(sv);
  return -k.b * skew(v) + k.c * (phi.dot(v) * Mat3::Identity() + phi * v.transpose() - 2 * v * phi.transpose()) +
         (k.db * sv + k.dc * ssv) * phi.transpose();
}

Pose exp_se3(const Vec6& xi) {
  Mat3 J;
  const Mat3 R = exp_so3(xi.tail<3>(), &J);
  return {J * xi.head<3>(), R};
}

Vec6 log_se3(const Pose& T) {
  Vec6 xi;
  xi.tail<3>() = log_so3(T.R);
  xi.head<3>() = left_jacobian_inverse_so3(xi.tail<3>()) * T.p;
  return xi;
}

Mat6 adjoint(const Pose& T) {
  Mat6 A;
  A << T.R, skew(T.p) * T.R, Mat3::Zero(), T.R;
  return A;
}

Mat6 adjoint_small(const Vec6& xi) {
  Mat6 A;
  A << skew(xi.tail<3>()), skew(xi.head<3>()), Mat3::Zero(), skew(xi.tail<3>());
  return A;
}

Mat6 left_jacobian_se3(const Vec6& xi) {
  const Vec3 rho = xi.head<3>(), phi = xi.tail<3>();
  const Mat3 J = left_jacobian_so3(phi);
  Mat6 out = Mat6::Zero();
  out.topLeftCorner<3, 3>() = J;
  out.bottomRightCorner<3, 3>() = J;
  // d(J rho)/dphi = Q' with Q = (dJ rho) + skew(J rho) J: the translation of exp moves with phi
  out.topRightCorner<3, 3>() = left_jacobian_derivative_so3(phi, rho) + skew(J * rho) * J;
  return out;
}

Mat3 rotation_about(const Vec3& u, double angle) {
  const double s = std::sin(angle), h = std::sin(0.5 * angle);
  const Mat3 S = skew(u);
  return Mat3::Identity() + s * S + (2 * h * h) * (S * S);
}

}  // namespace stiffmap
