// SPDX-License-Identifier: MIT
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "machines.hpp"
#include "numeric.hpp"
#include "stiffmap/kinematics/charts.hpp"
#include "stiffmap/plan/fast_plan.hpp"

using namespace stiffmap;
using namespace stiffmap::test;

namespace {

const Orthoglide& geometry() {
  static const Orthoglide g;
  return g;
}

Pose at(double x, double y, double z) { return {Vec3(x, y, z), Mat3::Identity()}; }

/// Actuator coordinates at a tip position.
Vec3 actuators(const Mechanism& m, const Pose& pose) {
  ClosureWorkspace ws(m);
  VecX x;
  const ClosureResult r = inverse_closure(m, pose, ws, x);
  BOOST_REQUIRE(r.status == Status::converged);
  return {x[m.drives[0].coordinate], x[m.drives[1].coordinate], x[m.drives[2].coordinate]};
}

/// A rod of which only the length is driven, on a ball at either end; `spin` (N m/rad) resists its turning about
/// itself.
Mechanism rod_on_two_balls(double spin = 0) {
  const auto ball = [](const std::string& n) {
    std::vector<Joint> axes{revolute(n + "1", Vec3::UnitX()), revolute(n + "2", Vec3::UnitY()),
                            revolute(n + "3", Vec3::UnitZ())};
    axes[0].ball = BallChart::free;
    return axes;
  };
  Chain rod;
  for (const Joint& j : ball("base")) rod.elements.emplace_back(j);
  rod.elements.emplace_back(actuator("length", JointType::prismatic, Vec3::UnitZ(), 1, 1e7));
  std::vector<Joint> top = ball("top");
  if (spin > 0) top[2].law = Law(spin);
  for (const Joint& j : top) rod.elements.emplace_back(j);
  return assemble({{Block{"legs", {{"rod", rod}}}}}, {Vec3(0, 0, 1), Mat3::Identity()});
}

}  // namespace

BOOST_AUTO_TEST_SUITE(closure)

BOOST_AUTO_TEST_CASE(orthoglide_stays_on_the_negative_root) {
  const Mechanism m = geometry().build();
  Random random(1);
  for (int i = 0; i < 30; ++i) {
    const double x = random.uniform(-0.2, 0.3), y = random.uniform(-0.2, 0.3), z = random.uniform(-0.2, 0.3);
    const Vec3 rho(geometry().rho(x, y, z), geometry().rho(y, z, x), geometry().rho(z, x, y));
    BOOST_TEST((actuators(m, at(x, y, z)) - rho).norm() < 1e-11);
  }
}

BOOST_AUTO_TEST_CASE(rows_of_the_inverse_jacobian) {
  const Mechanism m = geometry().build();
  const double x = 0.12, y = -0.15, z = 0.21, L = geometry().L;
  const double sx = std::sqrt(L * L - y * y - z * z), sy = std::sqrt(L * L - z * z - x * x),
               sz = std::sqrt(L * L - x * x - y * y);
  Mat3 rows;
  rows << 1, y / sx, z / sx, x / sy, 1, z / sy, x / sz, y / sz, 1;
  for (int k = 0; k < 3; ++k) {
    const auto value = [&](double h) {
      Vec3 p(x, y, z);
      p[k] += h;
      return actuators(m, {p, Mat3::Identity()});
    };
    const auto seen = central_difference(value, Vec3(rows.col(k)), 1e-2);
    BOOST_TEST(seen.error < 1e-4);
    BOOST_TEST(std::abs(seen.order - 2) < 0.05);
  }
}

BOOST_AUTO_TEST_CASE(forward_inverts_inverse) {
  const Mechanism m = geometry().build();
  ClosureWorkspace ws(m);
  VecX x;
  const Vec3 p(-0.11, 0.23, 0.05);
  const ClosureResult r = forward_closure(m, actuators(m, {p, Mat3::Identity()}), ws, x);
  BOOST_TEST((r.status == Status::converged));
  BOOST_TEST((r.tip.p - p).norm() < 1e-11);
  BOOST_TEST((r.tip.R - Mat3::Identity()).norm() < 1e-10);
}

BOOST_AUTO_TEST_CASE(unreachable_poses_say_so) {
  const Mechanism m = geometry().build();
  ClosureWorkspace ws(m);
  VecX x;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  BOOST_TEST((inverse_closure(m, at(0, 0.9, 0.2), ws, x).status == Status::unreachable));
  BOOST_TEST((inverse_closure(m, at(nan, 0, 0), ws, x).status == Status::unreachable));
  BOOST_TEST(
      (inverse_closure(m, {Vec3::Zero(), rotation_about(Vec3::UnitX(), 0.2)}, ws, x).status == Status::unreachable));
  BOOST_TEST((forward_closure(m, Vec3(nan, -0.8, -0.8), ws, x).status == Status::unreachable));
}

BOOST_AUTO_TEST_CASE(home_is_closed_from_rounded_coordinates) {
  // Home given to three digits only: the assembly closes it exactly.
  Orthoglide g = geometry();
  Chain leg = g.leg(0);
  std::get<Joint>(leg.elements[1]).home += 4e-4;
  const Mechanism m = assemble({{Block{"legs", {{"x", leg}, {"y", g.leg(1)}, {"z", g.leg(2)}}}}}, {});
  BOOST_TEST(std::abs(m.home_coordinates[m.drives[0].coordinate] + g.r + g.L) < 1e-12);
}

BOOST_AUTO_TEST_CASE(a_rod_on_two_ball_joints_spins) {
  const Mechanism m = rod_on_two_balls();
  int locked = 0;
  for (const Coordinate& c : m.coordinates) locked += c.locked;
  BOOST_TEST(locked == 1);
}

BOOST_AUTO_TEST_CASE(a_ball_has_the_coordinates_of_the_nearer_of_its_two_triples) {
  const Mechanism m = rod_on_two_balls();
  BOOST_REQUIRE(!m.balls.empty());
  const Index first = m.balls[0].first;
  Charts charts;
  charts.turns.resize(m.balls.size());
  charts.turns[0].used = true;
  Random random(4);
  for (int i = 0; i < 50; ++i) {
    VecX x = m.home_coordinates;
    for (Index k = 0; k < 3; ++k) x[first + k] = random.uniform(-1.2, 1.2);
    const VecX same = by_own_axes(m, charts, x, x);
    BOOST_TEST((same - x).cwiseAbs().maxCoeff() < 1e-12);
    // The other triple of the same rotation, asked for from near it.
    VecX other = x;
    other[first] += std::numbers::pi;
    other[first + 1] = std::numbers::pi - x[first + 1];
    other[first + 2] += std::numbers::pi;
    BOOST_TEST((by_own_axes(m, charts, x, other) - other).cwiseAbs().maxCoeff() < 1e-12);
  }
}

BOOST_AUTO_TEST_CASE(a_rod_that_spins_has_starts_all_over_the_box) {
  for (const double spin : {0.0, 50.0}) {
    const Mechanism m = rod_on_two_balls(spin);
    const Vec3 low(-0.1, -0.1, 0.9), high(0.1, 0.1, 1.1);
    const FastPlan plan(m, low, high);
    Random random(5);
    for (int i = 0; i < 20; ++i) {
      Vec3 p;
      for (int k = 0; k < 3; ++k) p[k] = random.uniform(low[k], high[k]);
      VecX x;
      BOOST_TEST(plan.nearest_start(m, p, x));
      Frames node(m);
      forward(m, Geometry::nominal, x, node);
      BOOST_TEST((node.at(m.tip).p - p).cwiseAbs().maxCoeff() < 0.2 / 14 + 1e-9);
    }
  }
}

BOOST_AUTO_TEST_CASE(limits_are_flags) {
  Orthoglide g = geometry();
  Chain leg = g.leg(0);
  std::get<Joint>(leg.elements[1]).lower = -0.9;
  std::get<Joint>(leg.elements[3]).upper = 0.1;
  const Mechanism m = assemble({{Block{"legs", {{"x", leg}, {"y", g.leg(1)}, {"z", g.leg(2)}}}}}, {});
  ClosureWorkspace ws(m);
  VecX x;
  BOOST_TEST(inverse_closure(m, at(0, 0, 0), ws, x).flags == 0u);
  BOOST_TEST(inverse_closure(m, at(-0.1, 0, 0), ws, x).flags == flag::drive_range);
  BOOST_TEST(inverse_closure(m, at(0.05, 0.2, 0), ws, x).flags == flag::joint_limit);
}

BOOST_AUTO_TEST_SUITE_END()
