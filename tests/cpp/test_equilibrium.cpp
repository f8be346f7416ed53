// SPDX-License-Identifier: MIT
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <numbers>

#include "machines.hpp"
#include "numeric.hpp"

using namespace stiffmap;
using namespace stiffmap::test;

BOOST_AUTO_TEST_SUITE(equilibrium)

BOOST_AUTO_TEST_CASE(cantilever_deflects_by_its_compliance) {
  const Mat6 C = beam_compliance(0.8, {2e8, 3e4, 3e4, 2e4});
  const Mechanism m =
      assemble({{shift("link", 0.8, 0, 0), virtual_spring("beam", C.inverse())}}, {Vec3(0.8, 0, 0), Mat3::Identity()});
  const PoseResult r = solve(m, m.home, Vec6(0, 3, 0, 0, 0, 0));
  BOOST_TEST((r.status == Status::converged));
  BOOST_TEST(std::abs(r.displacement[0][1] / (C(1, 1) * 3) - 1) < 1e-6);
  BOOST_TEST(std::abs(r.displacement[0][5] / (C(5, 1) * 3) - 1) < 1e-6);
}

BOOST_AUTO_TEST_CASE(hinge_under_a_side_force_has_its_closed_form) {
  // k q = F L cos q for a dead side force, k q = F L for a follower.
  const double k = 1e4, L = 0.5, F = 8e3;
  const Mechanism m = hinged_column(k, L);
  double q = 0;
  for (int i = 0; i < 200; ++i) q -= (k * q - F * L * std::cos(q)) / (k + F * L * std::sin(q));
  const Vec6 wrench(F, 0, 0, 0, 0, 0);
  BOOST_TEST(std::abs(solve(m, m.home, wrench).displacement[0][4] - q) < 1e-12);
  BOOST_TEST(std::abs(solve(m, m.home, wrench, LoadType::follower).displacement[0][4] - F * L / k) < 1e-12);
}

BOOST_AUTO_TEST_CASE(hinge_under_a_semitangential_moment) {
  // Turned by q about the moment's own axis: (tr R - 1) m / 2 = m cos q, four dead forces on levers.
  const double k = 1e4, M = 6e3;
  const Mechanism m = hinged_column(k, 0.5);
  double q = 0;
  for (int i = 0; i < 200; ++i) q -= (k * q - M * std::cos(q)) / (k + M * std::sin(q));
  const PoseResult r = solve(m, m.home, Vec6(0, 0, 0, 0, M, 0), LoadType::semitangential);
  BOOST_TEST(std::abs(r.displacement[0][4] - q) < 1e-12);
}

BOOST_AUTO_TEST_CASE(column_buckles_at_k_over_L) {
  const double k = 1e4, L = 0.5;
  const Mechanism m = hinged_column(k, L);
  const auto pressed = [&](double share) { return solve(m, m.home, Vec6(0, 0, -share * k / L, 0, 0, 0)).status; };
  BOOST_TEST((pressed(0.5) == Status::converged));
  BOOST_TEST((pressed(0.999) == Status::converged));
  BOOST_TEST((pressed(1.001) == Status::unstable));
  BOOST_TEST((pressed(5) == Status::unstable));
  BOOST_TEST((pressed(-5) == Status::converged));
}

BOOST_AUTO_TEST_CASE(stretched_column_stays_on_its_branch) {
  // A force through the hinge has two equilibria; load stepping keeps the commanded one.
  const Mechanism m = hinged_column(1e4, 0.5);
  const PoseResult r = solve(m, m.home, Vec6(10, 0, 1e6, 0, 0, 0));
  BOOST_TEST((r.status == Status::converged));
  BOOST_TEST(std::abs(r.displacement[0][4]) < 1e-4);
}

BOOST_AUTO_TEST_CASE(force_balance_vanishes_at_the_answer) {
  const Mechanism m = Orthoglide().build();
  SolveWorkspace ws(m);
  PoseInput in;
  in.commanded.p = Vec3(-0.1, 0.2, 0.05);
  in.load_points = {{m.tip, Vec3::Zero(), LoadType::dead}};
  in.wrenches = {Vec6(300, -200, 500, 20, -30, 10)};
  in.read_points = {0};
  PoseResult out;
  solve_pose(m, in, {}, ws, out);
  BOOST_REQUIRE((out.status == Status::converged));
  BOOST_TEST(ws.equilibrium.lin.r.cwiseAbs().maxCoeff() < 1e-5 * 300);
  BOOST_TEST(ws.equilibrium.lin.e.cwiseAbs().maxCoeff() < 1e-12);
}

BOOST_AUTO_TEST_CASE(load_steps_do_not_change_the_answer) {
  const Mechanism m = Orthoglide().build();
  const Vec6 w(2000, 2000, 0, 0, 0, 0);
  const Pose pose{Vec3(-0.2, -0.2, -0.2), Mat3::Identity()};
  const PoseResult automatic = solve(m, pose, w), stepped = solve(m, pose, w, LoadType::dead, 7);
  BOOST_TEST((automatic.displacement[0] - stepped.displacement[0]).norm() < 1e-10);
}

BOOST_AUTO_TEST_CASE(a_gap_is_crossed_and_a_stuck_drive_holds) {
  const double k = 1e4, L = 0.5, gap = 0.002;
  Joint hinge = actuator("hinge", JointType::revolute, Vec3::UnitY(), 0, k);
  hinge.law = Law(k, 0, {{-gap, 0}, {gap, 0}});
  const auto turn = [&](const Joint& j, double F) {
    const Mechanism m = assemble({{j, shift("column", 0, 0, L)}}, {Vec3(0, 0, L), Mat3::Identity()});
    return solve(m, m.home, Vec6(F, 0, 0, 0, 0, 0)).displacement[0][4];
  };
  BOOST_TEST(std::abs(turn(hinge, 2) - (gap + 2 * L / k)) < 1e-8);
  BOOST_TEST(std::abs(turn(hinge, -2) + (gap + 2 * L / k)) < 1e-8);
  hinge.law = Law(k, 0, {{0, -5}, {0, 5}});  // holds 5 N·m
  BOOST_TEST(std::abs(turn(hinge, 8)) < 1e-14);
  BOOST_TEST(std::abs(turn(hinge, 20) - (20 * L - 5) / k) < 1e-8);
}

BOOST_AUTO_TEST_SUITE_END()
