// SPDX-License-Identifier: MIT
// r is the derivative of nothing when loads are not conservative, so each load type is checked for
// itself: K - H against central differences of the force balance, with the observed order.
#include <boost/test/unit_test.hpp>

#include "machines.hpp"
#include "numeric.hpp"

using namespace stiffmap;
using namespace stiffmap::test;

namespace {

Problem loaded(const Mechanism& m, LoadType type) {
  Problem p(m);
  p.base = m.home_coordinates;
  p.load_points = {{m.tip, Vec3(0.02, -0.03, 0.1), type}, {m.tip, Vec3::Zero(), LoadType::dead}};
  p.wrenches = {Vec6(2e4, -3e4, 1e4, 4e3, 5e3, -6e3), Vec6(100, 0, 0, 0, 0, 0)};
  p.load_frames = {rotation_about(Vec3(0.6, 0, 0.8), 0.4), Mat3::Identity()};
  return p;
}

/// Checks K - H of a mechanism without loops along random directions.
void check_tangent(const Mechanism& m, const Problem& p, const VecX& z) {
  Linearization lin(m), moved(m);
  State state(m);
  state.z = z;
  linearize(m, p, state, lin);
  MatX T = (lin.K - lin.H) * lin.da.asDiagonal();
  for (Index j = 0; j < m.size(); ++j) T(j, j) += lin.dtau[j];
  Random random(3);
  for (int i = 0; i < 4; ++i) {
    const VecX d = random.vector(m.size(), 1);
    const auto value = [&](double h) {
      state.z = z + h * d;
      linearize(m, p, state, moved);
      return moved.r;
    };
    const VecX wanted = T * d;
    const double size = (lin.H * d).cwiseAbs().maxCoeff();
    const auto seen = central_difference(value, wanted, 2e-2);
    BOOST_TEST(seen.error < 1e-2 * size);
    BOOST_TEST(std::abs(seen.order - 2) < 0.1);
  }
}

}  // namespace

BOOST_AUTO_TEST_SUITE(linearization)

BOOST_AUTO_TEST_CASE(tangent_of_every_load_type) {
  const Mechanism m = arm();
  const VecX z = Random(5).vector(m.size(), 0.2);
  for (LoadType type : {LoadType::dead, LoadType::follower, LoadType::semitangential})
    check_tangent(m, loaded(m, type), z);
}

BOOST_AUTO_TEST_CASE(tangent_of_gravity_and_external_springs) {
  const Mechanism m = arm();
  Problem p(m);
  p.base = m.home_coordinates;
  p.gravity = Vec3(300, 0, -9810);
  check_tangent(m, p, Random(6).vector(m.size(), 0.2));
}

BOOST_AUTO_TEST_CASE(tangent_with_nonlinear_laws) {
  Joint hinge = actuator("hinge", JointType::revolute, Vec3::UnitY(), 0, 1e4);
  hinge.law = Law(1e4, 3e5);
  const Mechanism m = assemble({{hinge, shift("link", 0.5, 0, 0), virtual_spring("link_spring", link_stiffness())}},
                               {Vec3(0.5, 0, 0), Mat3::Identity()});
  check_tangent(m, loaded(m, LoadType::dead), Random(7).vector(m.size(), 0.2));
}

BOOST_AUTO_TEST_CASE(conservative_loads_have_a_symmetric_tangent) {
  const Mechanism m = arm();
  Linearization lin(m);
  State state(m);
  state.z = Random(8).vector(m.size(), 0.3);
  const auto asymmetry = [&](const Problem& p) {
    linearize(m, p, state, lin);
    return (lin.H - lin.H.transpose()).cwiseAbs().maxCoeff() / lin.H.cwiseAbs().maxCoeff();
  };
  Problem p = loaded(m, LoadType::semitangential);
  BOOST_TEST(asymmetry(p) < 1e-14);
  BOOST_TEST(!p.is_nonconservative());
  p = loaded(m, LoadType::dead);
  BOOST_TEST(asymmetry(p) > 1e-3);
  BOOST_TEST(p.is_nonconservative());
  p.wrenches[0].tail<3>().setZero();
  BOOST_TEST(asymmetry(p) < 1e-14);
  BOOST_TEST(!p.is_nonconservative());
}

BOOST_AUTO_TEST_CASE(follower_and_semitangential_start_as_the_dead_load) {
  const Mechanism m = arm();
  Linearization dead(m), other(m);
  const State state(m);
  Problem p = loaded(m, LoadType::dead);
  linearize(m, p, state, dead);
  p.load_frames = {dead.frames.at(m.tip).R, dead.frames.at(m.tip).R};
  for (LoadType type : {LoadType::follower, LoadType::semitangential}) {
    p.load_points[0].type = type;
    linearize(m, p, state, other);
    BOOST_TEST((other.r - dead.r).norm() < 1e-12 * dead.r.norm());
  }
}

BOOST_AUTO_TEST_CASE(loop_jacobian_is_the_derivative_of_the_closure) {
  const Mechanism m = Orthoglide().build();
  Problem p(m);
  p.base = m.home_coordinates;
  Linearization lin(m), moved(m);
  State state(m);
  linearize(m, p, state, lin);
  BOOST_TEST(lin.e.norm() < 1e-11);
  const VecX d = Random(9).vector(m.size(), 1);
  const auto value = [&](double h) {
    state.z = h * d;
    linearize(m, p, state, moved);
    return moved.e;
  };
  const auto seen = central_difference(value, VecX(lin.J * d), 1e-2);
  BOOST_TEST(seen.error < 1e-3);
  BOOST_TEST(std::abs(seen.order - 2) < 0.1);
}

BOOST_AUTO_TEST_CASE(loop_wrenches_enter_the_tangent) {
  // Along motions that keep the loops closed, with the multipliers' moments turned by half of the
  // rotation of their frame: theory (E5).
  const Mechanism m = Orthoglide().build();
  Problem p(m);
  p.base = m.home_coordinates;
  Linearization lin(m), moved(m);
  State state(m);
  const VecX lambda = Random(10).vector(m.closures(), 300);
  state.lambda = lambda;
  linearize(m, p, state, lin);
  const MatX null = Eigen::FullPivLU<MatX>(lin.J).kernel();
  const VecX d = null * Random(11).vector(null.cols(), 0.3);
  MatX T = (lin.K - lin.H) * lin.da.asDiagonal();
  for (Index j = 0; j < m.size(); ++j) T(j, j) += lin.dtau[j];
  BOOST_TEST((lin.H - lin.H.transpose()).norm() < 1e-14 * lin.H.norm());

  VecX turning = VecX::Zero(m.closures());
  for (std::size_t i = 0; i < m.loops.size(); ++i) {
    Vec3 w = Vec3::Zero();
    for (Index j : m.path[static_cast<std::size_t>(m.loops[i].end)])
      if (m.coordinates[static_cast<std::size_t>(j)].type == JointType::revolute) w += d[j] * lin.frames.axis.col(j);
    const Index row = 6 * static_cast<Index>(i) + 3;
    turning.segment<3>(row) = 0.5 * w.cross(lambda.segment<3>(row));
  }
  const auto value = [&](double h) {
    state.z = h * d;
    state.lambda = lambda + h * turning;
    linearize(m, p, state, moved);
    return moved.r;
  };
  const auto seen = central_difference(value, VecX(T * d), 4e-2);
  BOOST_TEST(seen.error < 1e-2 * (lin.H * d).cwiseAbs().maxCoeff());
  BOOST_TEST(std::abs(seen.order - 2) < 0.1);
}

BOOST_AUTO_TEST_SUITE_END()
