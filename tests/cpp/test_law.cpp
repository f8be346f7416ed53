// SPDX-License-Identifier: MIT
#include <boost/test/unit_test.hpp>
#include <utility>
#include <vector>

#include "numeric.hpp"
#include "stiffmap/model/law.hpp"

using namespace stiffmap;

namespace {

using Knots = std::vector<std::pair<double, double>>;

std::vector<Law> laws() {
  return {Law(1e6), Law(1e6, 1e14), Law(1e6, 0, {{-1e-5, 0}, {1e-5, 0}}),  // dead zone
          Law(2e6, 0, {{0, -40}, {0, 40}}),                                // stuck until 40 N
          Law(2e6, 0, {{-2e-5, -30}, {-1e-5, -10}, {0, -10}, {0, 5}, {3e-5, 5}, {4e-5, 90}})};
}

double slope(const Law& law, double z, double scale) {
  const LawPoint p = law.at(z, scale);
  return p.da + p.dtau / law.stiffness();
}

}  // namespace

BOOST_AUTO_TEST_SUITE(law)

BOOST_AUTO_TEST_CASE(graph_is_monotone_and_continuous) {
  for (const Law& law : laws())
    for (double scale : {1.0, 1.7}) {
      LawPoint before = law.at(-2e-4, scale);
      for (double z = -2e-4; z < 2e-4; z += 1e-7) {
        const LawPoint now = law.at(z, scale);
        BOOST_TEST(now.da >= 0);
        BOOST_TEST(now.dtau >= 0);
        BOOST_TEST(now.da + now.dtau > 0);
        BOOST_TEST(now.a >= before.a);
        BOOST_TEST(now.tau >= before.tau);
        BOOST_TEST(now.a - before.a < 3e-7);
        before = now;
      }
    }
}

BOOST_AUTO_TEST_CASE(tangent_is_the_derivative_of_the_graph) {
  for (const Law& law : laws())
    for (double scale : {1.0, 1.7})
      for (double z : {-1.37e-4, -1.23e-5, 0.31e-5, 2.01e-5, 1.11e-4}) {
        const double h = 1e-9;
        const LawPoint up = law.at(z + h, scale), down = law.at(z - h, scale), here = law.at(z, scale);
        BOOST_TEST(std::abs((up.a - down.a) / (2 * h) - here.da) < 1e-6);
        BOOST_TEST(std::abs((up.tau - down.tau) / (2 * h) - here.dtau) < 1e-6 * law.stiffness() * 10);
      }
}

BOOST_AUTO_TEST_CASE(parameter_of_a_polyline_advances_at_unit_rate) {
  // Whatever the scale of the drive's compliance, beyond the ends as well as between them.
  for (const Law& law : laws())
    if (law.has_knots())
      for (double scale : {1.0, 0.4, 1.7})
        for (double z = -2e-4; z < 2e-4; z += 1.7e-6) BOOST_TEST(std::abs(slope(law, z, scale) - 1) < 1e-12);
}

BOOST_AUTO_TEST_CASE(kinks_lie_on_the_graph) {
  const Knots knots{{-2e-5, -30}, {-1e-5, -10}, {0, -10}, {0, 5}, {3e-5, 5}, {4e-5, 90}};
  const Law law(2e6, 0, knots);
  for (const auto& [a, tau] : knots) {
    const LawPoint p = law.at(a + tau / law.stiffness());
    BOOST_TEST(std::abs(p.a - a) < 1e-18);
    BOOST_TEST(std::abs(p.tau - tau) < 1e-12);
  }
}

BOOST_AUTO_TEST_CASE(beyond_the_knots_the_slope_is_the_scaled_stiffness) {
  const Law law(2e6, 0, {{-1e-5, 0}, {1e-5, 0}});
  for (double scale : {1.0, 0.5, 3.0})
    for (double z : {-1e-4, 1e-4}) {
      const LawPoint p = law.at(z, scale);
      BOOST_TEST(std::abs(p.dtau / p.da * scale / 2e6 - 1) < 1e-12);
    }
}

BOOST_AUTO_TEST_CASE(from_force_finds_the_force) {
  for (const Law& law : laws())
    for (double scale : {1.0, 1.7})
      for (double tau : {-200.0, -31.0, -12.0, -3.0, 0.0, 4.0, 7.0, 89.0, 300.0}) {
        const double found = law.at(law.from_force(tau, scale), scale).tau;
        BOOST_TEST(std::abs(found - tau) < 1e-9 * (1 + std::abs(tau)));
      }
}

BOOST_AUTO_TEST_CASE(from_force_takes_the_middle_of_a_gap) {
  const Law law(1e6, 0, {{-1e-5, 0}, {3e-5, 0}});
  BOOST_TEST(std::abs(law.at(law.from_force(0)).a - 1e-5) < 1e-15);
}

BOOST_AUTO_TEST_CASE(bad_laws_are_refused) {
  BOOST_CHECK_THROW(Law(0), std::invalid_argument);
  BOOST_CHECK_THROW(Law(-1), std::invalid_argument);
  BOOST_CHECK_THROW(Law(1, -1), std::invalid_argument);
  BOOST_CHECK_THROW(Law(1, 0, {{0, 0}}), std::invalid_argument);
  BOOST_CHECK_THROW(Law(1, 0, {{0, 0}, {1, -1}}), std::invalid_argument);
  BOOST_CHECK_THROW(Law(1, 0, {{0, 0}, {0, 0}}), std::invalid_argument);
  BOOST_CHECK_THROW(Law(1, 1, {{0, 0}, {1, 1}}), std::invalid_argument);
}

BOOST_AUTO_TEST_SUITE_END()
