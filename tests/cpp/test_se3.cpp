// SPDX-License-Identifier: MIT
#include <boost/test/unit_test.hpp>
#include <numbers>
#include <vector>

#include "numeric.hpp"
#include "stiffmap/se3.hpp"

using namespace stiffmap;
using test::central_difference;
using test::Random;

namespace {

/// Rotation vectors at identity, tiny, at the borders of the series, random, and near pi.
std::vector<Vec3> probes() {
  std::vector<Vec3> out{Vec3::Zero(), Vec3(1e-12, -2e-12, 3e-12), Vec3(1e-8, 0, -1e-8)};
  Random random(1);
  for (double size : {0.9e-3, 1.1e-3, 0.9e-2, 1.1e-2, 0.09, 0.11, 0.5, 2.0, 3.0, std::numbers::pi - 1e-6})
    for (int i = 0; i < 4; ++i) out.push_back(size * random.vector<3>().normalized());
  return out;
}

std::vector<Vec6> twist_probes() {
  std::vector<Vec6> out;
  Random random(2);
  for (const Vec3& phi : probes()) {
    Vec6 xi;
    xi << random.vector<3>(), phi;
    out.push_back(xi);
  }
  return out;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(se3)

BOOST_AUTO_TEST_CASE(log_inverts_exp) {
  for (const Vec3& phi : probes()) BOOST_TEST((log_so3(exp_so3(phi)) - phi).norm() < 1e-12 * (1 + phi.norm()));
  for (const Vec6& xi : twist_probes()) BOOST_TEST((log_se3(exp_se3(xi)) - xi).norm() < 4e-12 * (1 + xi.norm()));
}

BOOST_AUTO_TEST_CASE(log_at_half_a_turn) {
  for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(0.6, 0.0, -0.8)}) {
    const Vec3 phi = log_so3(exp_so3(std::numbers::pi * axis));
    BOOST_TEST(std::abs(phi.norm() - std::numbers::pi) < 1e-12);
    BOOST_TEST(phi.cross(axis).norm() < 1e-12);
  }
}

BOOST_AUTO_TEST_CASE(exp_is_a_rotation) {
  for (const Vec3& phi : probes()) {
    const Mat3 R = exp_so3(phi);
    BOOST_TEST((R.transpose() * R - Mat3::Identity()).norm() < 1e-14);
    BOOST_TEST(std::abs(R.determinant() - 1) < 1e-14);
  }
}

BOOST_AUTO_TEST_CASE(exp_agrees_with_rotation_about) {
  Random random(3);
  const Vec3 u = random.vector<3>().normalized();
  for (double a : {0.0, 1e-9, 0.02, 1.0, -2.5}) BOOST_TEST((exp_so3(a * u) - rotation_about(u, a)).norm() < 1e-15 * 10);
}

BOOST_AUTO_TEST_CASE(left_jacobian_is_the_derivative_of_exp) {
  Random random(4);
  for (const Vec3& phi : {Vec3(0.4, -0.3, 0.8), Vec3(2.0, 1.0, -0.5), Vec3(0.02, 0.01, 0.0)}) {
    const Vec3 d = random.vector<3>().normalized();
    const auto value = [&](double h) { return log_so3(exp_so3(phi + h * d) * exp_so3(phi).transpose()); };
    const auto seen = central_difference(value, Vec3(left_jacobian_so3(phi) * d), 1e-2);
    BOOST_TEST(seen.error < 1e-4);
    BOOST_TEST(std::abs(seen.order - 2) < 0.05);
  }
}

BOOST_AUTO_TEST_CASE(left_jacobian_inverse) {
  for (const Vec3& phi : probes())
    BOOST_TEST((left_jacobian_so3(phi) * left_jacobian_inverse_so3(phi) - Mat3::Identity()).norm() < 1e-9);
}

BOOST_AUTO_TEST_CASE(derivative_of_the_left_jacobian) {
  Random random(5);
  for (const Vec3& phi : {Vec3(0.4, -0.3, 0.8), Vec3(2.0, 1.0, -0.5), Vec3(0.05, 0.02, -0.04)}) {
    const Vec3 d = random.vector<3>().normalized(), v = random.vector<3>();
    const auto value = [&](double h) -> Vec3 { return left_jacobian_so3(phi + h * d) * v; };
    const auto seen = central_difference(value, Vec3(left_jacobian_derivative_so3(phi, v) * d), 1e-2);
    BOOST_TEST(seen.error < 1e-4);
    BOOST_TEST(std::abs(seen.order - 2) < 0.05);
  }
}

BOOST_AUTO_TEST_CASE(series_and_closed_form_meet) {
  // On both sides of every switch between a series and its closed form the values must agree.
  Random random(6);
  for (double size : {1e-3, 1e-2, 0.1}) {
    const Vec3 u = random.vector<3>().normalized(), v = random.vector<3>();
    const Vec3 below = size * (1 - 1e-9) * u, above = size * (1 + 1e-9) * u;
    BOOST_TEST((exp_so3(below) - exp_so3(above)).norm() < 1e-9);
    BOOST_TEST((left_jacobian_so3(below) - left_jacobian_so3(above)).norm() < 1e-9);
    BOOST_TEST((left_jacobian_inverse_so3(below) - left_jacobian_inverse_so3(above)).norm() < 1e-9);
    BOOST_TEST((left_jacobian_derivative_so3(below, v) - left_jacobian_derivative_so3(above, v)).norm() < 1e-8);
  }
}

BOOST_AUTO_TEST_CASE(left_jacobian_of_a_twist) {
  Random random(7);
  for (const Vec3& phi : {Vec3(0.4, -0.3, 0.8), Vec3(2.0, 1.0, -0.5)}) {
    Vec6 xi;
    xi << random.vector<3>(), phi;
    const Vec6 d = random.vector<6>();
    const auto value = [&](double h) { return log_se3(exp_se3(xi + h * d) * exp_se3(xi).inverse()); };
    const auto seen = central_difference(value, Vec6(left_jacobian_se3(xi) * d), 1e-2);
    BOOST_TEST(seen.error < 1e-3);
    BOOST_TEST(std::abs(seen.order - 2) < 0.05);
  }
}

BOOST_AUTO_TEST_CASE(adjoint_carries_twists) {
  // exp(Ad_T xi) = T exp(xi) T^-1
  Random random(8);
  for (int i = 0; i < 5; ++i) {
    const Pose T = exp_se3(random.vector<6>());
    const Vec6 xi = random.vector<6>();
    const Pose left = exp_se3(adjoint(T) * xi), right = T * exp_se3(xi) * T.inverse();
    BOOST_TEST((left.p - right.p).norm() < 1e-13);
    BOOST_TEST((left.R - right.R).norm() < 1e-13);
  }
}

BOOST_AUTO_TEST_CASE(adjoint_is_a_homomorphism) {
  Random random(9);
  const Pose a = exp_se3(random.vector<6>()), b = exp_se3(random.vector<6>());
  BOOST_TEST((adjoint(a * b) - adjoint(a) * adjoint(b)).norm() < 1e-13);
  BOOST_TEST((adjoint(a).inverse() - adjoint(a.inverse())).norm() < 1e-13);
}

BOOST_AUTO_TEST_CASE(small_adjoint_is_the_derivative_of_the_adjoint) {
  Random random(10);
  const Vec6 xi = random.vector<6>();
  const auto value = [&](double h) { return adjoint(exp_se3(h * xi)); };
  const auto seen = central_difference(value, adjoint_small(xi), 1e-2);
  BOOST_TEST(seen.error < 1e-4);
  BOOST_TEST(std::abs(seen.order - 2) < 0.05);
}

BOOST_AUTO_TEST_SUITE_END()
