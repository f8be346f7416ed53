// SPDX-License-Identifier: MIT
#include <boost/test/unit_test.hpp>
#include <stdexcept>
#include <string>

#include "machines.hpp"
#include "messages.hpp"
#include "numeric.hpp"

using namespace stiffmap;
using namespace stiffmap::test;

BOOST_AUTO_TEST_SUITE(mechanism)

BOOST_AUTO_TEST_CASE(orthoglide_is_flattened) {
  const Mechanism m = Orthoglide().build();
  // per leg: actuator, foot 6, two pins, twice two pins and a bar of 6
  BOOST_TEST(m.size() == 3 * (1 + 6 + 2 + 2 * (2 + 6)));
  BOOST_TEST(m.loops.size() == 3u + 2u);
  BOOST_TEST(m.drives.size() == 3u);
  BOOST_TEST(m.legs == (std::vector<std::string>{"x", "y", "z"}), boost::test_tools::per_element());
  BOOST_TEST(m.coordinates[0].name == "x.actuator");
  BOOST_TEST(m.points.front().name == "tcp");
}

BOOST_AUTO_TEST_CASE(paths_lead_from_the_base_outwards) {
  const Mechanism m = Orthoglide().build();
  for (std::size_t i = 1; i < m.nodes.size(); ++i) {
    const auto& parent = m.path[static_cast<std::size_t>(m.nodes[i].parent)];
    const auto& path = m.path[i];
    BOOST_REQUIRE(path.size() == parent.size() + (m.nodes[i].coordinate >= 0));
    BOOST_TEST(std::equal(parent.begin(), parent.end(), path.begin()));
    BOOST_TEST(m.nodes[i].parent < static_cast<Index>(i));
  }
}

BOOST_AUTO_TEST_CASE(platform_side_of_the_legs) {
  Chain root{{Block{"legs", {{"only", {{revolute("free", Vec3::UnitZ()), virtual_spring("link", link_stiffness())}}}}},
              shift("tool", 0, 0, -0.1), Body{"spindle", 6, Vec3::Zero()}}};
  const Mechanism m = assemble(root, {Vec3(0, 0, -0.1), Mat3::Identity()});
  BOOST_TEST(m.beyond_legs[static_cast<std::size_t>(m.tip)]);
  BOOST_TEST(!m.beyond_legs[1]);
  BOOST_TEST(m.beyond_legs[static_cast<std::size_t>(m.bodies[0].node)]);
}

BOOST_AUTO_TEST_CASE(scales_follow_the_size_of_the_machine) {
  Orthoglide small, large;
  large.L = 10 * small.L;
  large.d = 10 * small.d;
  large.r = 10 * small.r;
  BOOST_TEST(std::abs(large.build().length / small.build().length - 10) < 1e-9);
}

BOOST_AUTO_TEST_CASE(a_link_beside_the_base_has_its_reach_as_length) {
  const Chain chain{{shift("far", 0.8, 0, 0), virtual_spring("link", link_stiffness())}};
  BOOST_TEST(std::abs(assemble(chain, {Vec3(0.8, 0, 0), Mat3::Identity()}).length - 0.8) < 1e-12);
}

BOOST_AUTO_TEST_CASE(columns_are_the_derivatives_of_the_frames) {
  const Mechanism m = Orthoglide().build();
  Random random(11);
  VecX x = m.home_coordinates + random.vector(m.size(), 0.2);
  Frames f(m), g(m);
  for (std::size_t node = 1; node < m.nodes.size(); node += 7) {
    forward(m, Geometry::nominal, x, f);
    for (Index j : m.path[node]) {
      const auto value = [&](double h) {
        VecX y = x;
        y[j] += h;
        forward(m, Geometry::nominal, y, g);
        return frame_error(f.pose[node], g.pose[node]);
      };
      const Vec6 c = column(m, f, j, f.pose[node].p);
      const auto seen = central_difference(value, c, 1e-2);
      BOOST_TEST(seen.error < 1e-4);
      if (seen.error > 1e-10) BOOST_TEST(std::abs(seen.order - 2) < 0.1);
    }
  }
}

BOOST_AUTO_TEST_CASE(bad_chains_are_refused_by_name) {
  BOOST_TEST(contains(message([] { assemble({{revolute("pin", Vec3(0, 0, 2))}}, {}); }), "pin.axis"));
  BOOST_TEST(contains(message([] { assemble({{revolute("pin", Vec3::Zero())}}, {}); }), "unit vector"));
  const Chain twice{{revolute("pin", Vec3::UnitZ()), revolute("pin", Vec3::UnitX())}};
  BOOST_TEST(contains(message([&] { assemble(twice, {}); }), "pin"));
  BOOST_TEST(contains(message([] { assemble({{Block{"bars", {}}}}, {}); }), "bars"));
  ExternalSpring hose;
  hose.point = "nowhere";
  BOOST_TEST(
      contains(message([&] { assemble({{shift("a", 1, 0, 0)}}, {Vec3(1, 0, 0), Mat3::Identity()}, {hose}); }), "tcp"));
}

BOOST_AUTO_TEST_CASE(a_block_that_does_not_close_is_refused_with_its_misfit) {
  const auto bar = [](double length) {
    return Chain{{shift("length", length, 0, 0), virtual_spring("link", link_stiffness())}};
  };
  const Chain chain{{Block{"bars", {{"low", bar(0.5)}, {"high", bar(0.7)}}}}};
  const std::string text = message([&] { assemble(chain, {Vec3(0.5, 0, 0), Mat3::Identity()}); });
  BOOST_TEST(contains(text, "high 0.2 m 0 rad"));
}

BOOST_AUTO_TEST_SUITE_END()
