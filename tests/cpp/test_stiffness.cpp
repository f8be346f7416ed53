// SPDX-License-Identifier: MIT
#include <boost/test/unit_test.hpp>
#include <cmath>

#include "machines.hpp"
#include "numeric.hpp"

using namespace stiffmap;
using namespace stiffmap::test;

namespace {

Mat6 random_stiffness(unsigned seed) {
  Random random(seed);
  Mat6 K = 1e6 * Mat6::Identity();
  for (int i = 0; i < 6; ++i) {
    const Vec6 v = random.vector<6>(1e3);
    K += v * v.transpose();
  }
  return K;
}

double relative(const Mat6& got, const Mat6& wanted) {
  const Vec6 s = wanted.diagonal().cwiseAbs().cwiseSqrt().cwiseInverse();
  return (s.asDiagonal() * (got - wanted) * s.asDiagonal()).cwiseAbs().maxCoeff();
}

}  // namespace

BOOST_AUTO_TEST_SUITE(stiffness)

BOOST_AUTO_TEST_CASE(series_and_parallel) {
  const Mat6 A = random_stiffness(1), B = random_stiffness(2);
  const Mechanism series = assemble({{virtual_spring("a", A), virtual_spring("b", B)}}, {});
  BOOST_TEST(relative(solve(series, {}, Vec6::Zero()).point.compliance, A.inverse() + B.inverse()) < 1e-11);
  const Mechanism parallel =
      assemble({{Block{"legs", {{"a", {{virtual_spring("s", A)}}}, {"b", {{virtual_spring("s", B)}}}}}}}, {});
  BOOST_TEST(relative(solve(parallel, {}, Vec6::Zero()).point.stiffness, A + B) < 1e-11);
}

BOOST_AUTO_TEST_CASE(cantilever_stiffness) {
  const Mat6 C = beam_compliance(0.8, {2e8, 3e4, 3e4, 2e4});
  const Mechanism m =
      assemble({{shift("link", 0.8, 0, 0), virtual_spring("beam", C.inverse())}}, {Vec3(0.8, 0, 0), Mat3::Identity()});
  const PoseResult r = solve(m, m.home, Vec6::Zero());
  BOOST_TEST(std::abs(r.point.stiffness(1, 1) / (12 * 3e4 / 0.512) - 1) < 1e-11);
  BOOST_TEST(relative(r.point.compliance, C) < 1e-11);
}

BOOST_AUTO_TEST_CASE(a_passive_joint_frees_its_twist) {
  const Mechanism m = assemble({{virtual_spring("link", random_stiffness(3)), revolute("pin", Vec3::UnitZ())}}, {});
  const PoseResult r = solve(m, {}, Vec6::Zero());
  BOOST_TEST((r.status == Status::singular));
  BOOST_TEST((r.flags & flag::platform_singular) != 0u);
  BOOST_TEST(r.point.free == 1);
  BOOST_TEST(std::abs(std::abs(r.point.free_twists(5, 0)) - 1) < 1e-9);
  BOOST_TEST(r.point.free_twists.col(1).array().isNaN().all());
  BOOST_TEST(r.point.compliance.array().isNaN().all());
  BOOST_TEST(r.displacement[0].array().isNaN().all());
  BOOST_TEST(r.point.stiffness.col(5).norm() < 1e-6);
}

BOOST_AUTO_TEST_CASE(dead_moment_makes_the_stiffness_asymmetric_by_law) {
  const Mechanism m = Orthoglide().build();
  const Vec3 moment(12, -25, 31);
  Vec6 w;
  w << 300, -200, 100, moment;
  const Mat6 K = solve(m, {Vec3(0.1, -0.05, 0.2), Mat3::Identity()}, w).point.stiffness;
  Mat6 wanted = Mat6::Zero();
  wanted.bottomRightCorner<3, 3>() = -skew(moment);
  BOOST_TEST((K - K.transpose() - wanted).bottomRightCorner(3, 3).cwiseAbs().maxCoeff() < 1e-5);
  BOOST_TEST((K - K.transpose()).topLeftCorner(3, 3).cwiseAbs().maxCoeff() < 1e-7 * K(0, 0));
  w.tail<3>().setZero();
  const Mat6 S = solve(m, {Vec3(0.1, -0.05, 0.2), Mat3::Identity()}, w).point.stiffness;
  BOOST_TEST(relative(S, S.transpose()) < 1e-11);
}

BOOST_AUTO_TEST_CASE(loaded_hinge_has_its_closed_form) {
  // Tangent in q of k q - F L cos q: k + F L sin q; tip compliance (L cos q)^2 over it.
  const double k = 1e4, L = 0.5, F = 8e3;
  const Mechanism m = hinged_column(k, L);
  const PoseResult r = solve(m, m.home, Vec6(F, 0, 0, 0, 0, 0));
  const double q = r.displacement[0][4], tangent = k + F * L * std::sin(q);
  BOOST_TEST((r.flags & flag::rigid_direction) != 0u);
  BOOST_TEST(std::abs(r.point.compliance(4, 4) * tangent - 1) < 1e-10);
  BOOST_TEST(std::abs(r.point.compliance(0, 0) * tangent / std::pow(L * std::cos(q), 2) - 1) < 1e-10);
}

BOOST_AUTO_TEST_CASE(compliance_is_the_derivative_of_the_equilibrium) {
  const Mechanism m = Orthoglide().build();
  const Pose pose{Vec3(-0.12, 0.2, 0.05), Mat3::Identity()};
  const Vec6 w(900, -600, 1500, 40, -60, 80);
  for (LoadType type : {LoadType::dead, LoadType::follower, LoadType::semitangential}) {
    // `type` carries w; the extra wrench is dead
    PoseInput in;
    in.commanded = pose;
    in.load_points = {{m.tip, Vec3::Zero(), type}, {m.tip, Vec3::Zero(), LoadType::dead}};
    in.wrenches = {w, Vec6::Zero()};
    in.read_points = {0};
    SolveWorkspace ws(m);
    PoseResult out, there;
    solve_pose(m, in, {}, ws, out);
    const Vec3 turned = out.displacement[0].tail<3>();
    // (25) itself, before the answer of the bordered tangent may take its place
    const EquilibriumWorkspace& eq = ws.equilibrium;
    StiffnessWorkspace own(m);
    const StiffnessResult direct = point_stiffness(m, eq.lin, eq.saddle, m.tip, Vec3::Zero(), own);
    BOOST_TEST(direct.flags == 0u);
    BOOST_TEST(relative(direct.compliance, out.point.compliance) < 1e-9);
    BOOST_TEST(relative(direct.stiffness * direct.compliance, Mat6::Identity()) < 1e-9);
    for (int k = 0; k < 6; k += 2) {
      const auto value = [&](double h) {
        in.wrenches[1] = (k < 3 ? 1e5 : 2e4) * h * Vec6::Unit(k);
        solve_pose(m, in, {}, ws, there);
        Vec6 twist = there.displacement[0];
        twist.tail<3>() = log_so3(exp_so3(twist.tail<3>()) * exp_so3(turned).transpose());
        return twist;
      };
      const Vec6 wanted = (k < 3 ? 1e5 : 2e4) * direct.compliance.col(k);
      const auto seen = central_difference(value, wanted, 0.1);
      BOOST_TEST(seen.error < 1e-2 * wanted.cwiseAbs().maxCoeff());
      BOOST_TEST(std::abs(seen.order - 2) < 0.15);
    }
  }
}

BOOST_AUTO_TEST_SUITE_END()
