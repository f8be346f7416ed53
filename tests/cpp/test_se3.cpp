// SPDX-License-Identifier: MIT
#include <boost/test/unit_test.hpp>
#include <numbers>
#include <vector>

#include "numeric.hpp"
#include "stiffmap/algebra/se3.hpp"

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

}  // namespace

BOOST_AUTO_TEST_SUITE(se3)

BOOST_AUTO_TEST_CASE(log_inverts_exp) {
  for (const Vec3& phi : probes()) BOOST_TEST((log_so3(exp_so3(phi)) - phi).norm() < 1e-12 * (1 + phi.norm()));
}

BOOST_AUTO_TEST_CASE(every_term_of_the_series_is_needed) {
  // About z the sine stands alone, and in the plane z = 0 the cosine does: their last terms are 5e-15 and 2e-15 of
  // them.
  for (const double t : {0.3e-3, 0.7e-3, 0.99e-3, 1.01e-3, 0.1}) {
    BOOST_TEST(std::abs(exp_so3(Vec3(0, 0, t))(1, 0) / std::sin(t) - 1) < 7e-16);
    const double h = std::sin(0.5 * t), x = 0.6 * t, y = 0.8 * t;
    BOOST_TEST(std::abs(exp_so3(Vec3(x, y, 0))(0, 1) / (2 * h * h * 0.48) - 1) < 1e-15);
  }
}

BOOST_AUTO_TEST_CASE(log_of_a_small_rotation_has_all_its_digits) {
  for (const double t : {1e-14, 1e-10, 1e-7})
    BOOST_TEST(std::abs(log_so3(exp_so3(Vec3(0, -t, 0)))[1] / -t - 1) < 1e-15);
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

BOOST_AUTO_TEST_CASE(series_and_closed_form_meet) {
  // On both sides of every switch between a series and its closed form the values must agree.
  Random random(6);
  for (double size : {1e-3}) {
    const Vec3 u = random.vector<3>().normalized();
    const Vec3 below = size * (1 - 1e-9) * u, above = size * (1 + 1e-9) * u;
    BOOST_TEST((exp_so3(below) - exp_so3(above)).norm() < 1e-9);
  }
}

BOOST_AUTO_TEST_SUITE_END()
