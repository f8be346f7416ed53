// SPDX-License-Identifier: MIT
#include <Eigen/Eigenvalues>
#include <boost/test/unit_test.hpp>
#include <stdexcept>
#include <string>

#include "beam.hpp"
#include "messages.hpp"
#include "numeric.hpp"
#include "stiffmap/model/spring.hpp"

using namespace stiffmap;
using test::contains;
using test::message;
using test::Random;

namespace {

Mat6 random_spd(unsigned seed, int rank = 6) {
  Random random(seed);
  Mat6 M = Mat6::Zero();
  for (int i = 0; i < rank; ++i) {
    const Vec6 v = random.vector<6>();
    M += v * v.transpose();
  }
  return M;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(spring)

BOOST_AUTO_TEST_CASE(compliance_is_inverted) {
  const Mat6 C = random_spd(1);
  const SpringMatrix s = spring_from_compliance(C, "link");
  BOOST_TEST(!s.rotated);
  BOOST_TEST(!s.rigid.any());
  BOOST_TEST((s.stiffness * C - Mat6::Identity()).norm() < 1e-9);
}

BOOST_AUTO_TEST_CASE(zero_diagonal_of_a_compliance_is_rigid) {
  Mat6 C = Vec6(1e-6, 0, 2e-6, 0, 1e-5, 3e-5).asDiagonal();
  C(0, 2) = C(2, 0) = 5e-7;
  const SpringMatrix s = spring_from_compliance(C, "link");
  BOOST_TEST(!s.rotated);
  BOOST_TEST((s.rigid[1] && s.rigid[3] && !s.rigid[0] && !s.rigid[2] && !s.rigid[4] && !s.rigid[5]));
  BOOST_TEST(std::abs(s.stiffness(0, 0) - C(2, 2) / (C(0, 0) * C(2, 2) - C(0, 2) * C(0, 2))) < 1e-3);
}

BOOST_AUTO_TEST_CASE(hidden_rank_defect_of_a_compliance_is_found) {
  const Mat6 C = random_spd(2, 4);
  const SpringMatrix s = spring_from_compliance(C, "link");
  BOOST_TEST(s.rotated);
  BOOST_TEST(s.rigid.count() == 2);
  const Mat6 K = s.basis * s.stiffness * s.basis.transpose();
  BOOST_TEST((C * K * C - C).norm() < 1e-9 * C.norm());  // the pseudo-inverse
}

BOOST_AUTO_TEST_CASE(stiffness_may_lack_rank) {
  const Mat6 K = random_spd(3, 3);
  BOOST_TEST((spring_from_stiffness(K, "link").stiffness - K).norm() < 1e-14);
}

BOOST_AUTO_TEST_CASE(asymmetry_is_refused_with_its_size) {
  Mat6 K = Mat6::Identity() * 100;
  K(0, 1) = 32;
  const std::string text = message([&] { spring_from_stiffness(K, "leg.bar"); });
  BOOST_TEST(contains(text, "leg.bar"));
  BOOST_TEST(contains(text, "symmetric"));
  BOOST_TEST(contains(text, "32"));
}

BOOST_AUTO_TEST_CASE(indefinite_matrices_are_refused) {
  Mat6 K = Mat6::Identity();
  K(0, 1) = K(1, 0) = 2;
  BOOST_TEST(contains(message([&] { spring_from_compliance(K, "bar"); }), "-1"));
  K = Mat6::Identity();
  K(3, 3) = -5;
  BOOST_TEST(contains(message([&] { spring_from_stiffness(K, "bar"); }), "-5"));
  K = Mat6::Identity();
  K(2, 2) = 0;
  K(2, 3) = K(3, 2) = 0.1;
  BOOST_TEST(contains(message([&] { spring_from_stiffness(K, "bar"); }), "coupling"));
}

/// Ones on the diagonal, so that scaling changes nothing, and one pair of eigenvalues 1 +- c.
Mat6 coupled(double c) {
  Mat6 M = Mat6::Identity();
  M(1, 4) = M(4, 1) = c;
  return M;
}

BOOST_AUTO_TEST_CASE(a_matrix_is_indefinite_from_1e_9_on) {
  // Round-off of a matrix of less than full rank passes; an eigenvalue that arithmetic cannot explain does not.
  for (const double size : {1.0, 1e-8, 1e7}) {
    BOOST_CHECK_NO_THROW(spring_from_stiffness(size * coupled(1 + 5e-10), "bar"));
    BOOST_CHECK_NO_THROW(spring_from_compliance(size * coupled(1 + 5e-10), "bar"));
    BOOST_CHECK_THROW(spring_from_stiffness(size * coupled(1 + 2e-9), "bar"), std::invalid_argument);
    BOOST_CHECK_THROW(spring_from_compliance(size * coupled(1 + 2e-9), "bar"), std::invalid_argument);
  }
}

BOOST_AUTO_TEST_CASE(a_matrix_is_asymmetric_from_1e_9_on) {
  Mat6 M = coupled(0.5);
  M(4, 1) += 5e-10;
  BOOST_CHECK_NO_THROW(spring_from_stiffness(M, "bar"));
  M(4, 1) += 1e-9;
  BOOST_CHECK_THROW(spring_from_stiffness(M, "bar"), std::invalid_argument);
}

BOOST_AUTO_TEST_CASE(a_compliance_loses_rank_below_1e_9) {
  const SpringMatrix soft = spring_from_compliance(coupled(1 - 3e-9), "bar");
  BOOST_TEST(!soft.rotated);
  BOOST_TEST(!soft.rigid.any());
  BOOST_TEST(std::abs(soft.stiffness(1, 1) * 3e-9 * (2 - 3e-9) - 1) < 1e-6);  // 1 / (1 - c^2)
  const SpringMatrix rigid = spring_from_compliance(coupled(1 - 3e-10), "bar");
  BOOST_TEST(rigid.rotated);
  BOOST_TEST(rigid.rigid.count() == 1);
}

BOOST_AUTO_TEST_CASE(a_table_is_linear_between_its_rows) {
  // Rows of different shape, so that each interval and each share of it gives a compliance of its own.
  const Mat6 A = random_spd(7), B = random_spd(8), C = random_spd(9);
  Stroke stroke;
  stroke.joint = "slide";
  stroke.table = {{-0.5, A}, {0.25, B}, {1.5, C}};
  const SpringMatrix matrix = spring_from_compliance(A, "link");
  BOOST_CHECK_NO_THROW(check_stroke(stroke, matrix, "link"));
  const auto compliance = [&](double u) {
    Mat6 K;
    BOOST_TEST(stiffness_at(stroke, matrix, u, K));
    BOOST_TEST((K - K.transpose()).norm() == 0);
    return Mat6(K.inverse());
  };
  const auto near = [](const Mat6& got, const Mat6& wanted) { return (got - wanted).norm() < 1e-8 * wanted.norm(); };
  BOOST_TEST(near(compliance(-0.5), A));
  BOOST_TEST(near(compliance(-0.2), 0.6 * A + 0.4 * B));
  BOOST_TEST(near(compliance(0.25), B));
  BOOST_TEST(near(compliance(0.5), 0.8 * B + 0.2 * C));
  BOOST_TEST(near(compliance(1.5), C));
  Mat6 K;
  const double slack = 2e-9;  // 1e-9 of the width of 2
  BOOST_TEST(stiffness_at(stroke, matrix, -0.5 - 0.9 * slack, K));
  BOOST_TEST(stiffness_at(stroke, matrix, 1.5 + 0.9 * slack, K));
  BOOST_TEST(!stiffness_at(stroke, matrix, -0.5 - 1.1 * slack, K));
  BOOST_TEST(!stiffness_at(stroke, matrix, 1.5 + 1.1 * slack, K));
}

BOOST_AUTO_TEST_CASE(a_beam_that_grows_has_the_compliance_of_its_length) {
  const test::BeamSection section{2e8, 3e4, 3e4, 2e4};
  Stroke stroke;
  stroke.joint = "slide";
  stroke.at = 0.1;
  stroke.length = 0.8;
  stroke.rate = -2;
  const SpringMatrix matrix = spring_from_compliance(test::beam_compliance(0.8, section), "beam");
  for (const double u : {0.1, 0.3, -0.4}) {
    Mat6 K;
    BOOST_TEST(stiffness_at(stroke, matrix, u, K));
    const Mat6 wanted = test::beam_compliance(0.8 - 2 * (u - 0.1), section).inverse();
    BOOST_TEST((K - wanted).norm() < 1e-9 * wanted.norm());
  }
  Mat6 K;
  BOOST_TEST(!stiffness_at(stroke, matrix, 0.5, K));  // no length
}

BOOST_AUTO_TEST_CASE(nan_is_refused) {
  Mat6 K = Mat6::Identity();
  K(4, 4) = std::nan("");
  BOOST_TEST(contains(message([&] { spring_from_stiffness(K, "bar"); }), "finite"));
}

BOOST_AUTO_TEST_CASE(rank_decisions_do_not_depend_on_units) {
  // The same beam in millimetres and newtons, and in metres: no rank is lost in either.
  const Mat6 C = test::beam_compliance(0.25, {2e8, 2e4, 2e4, 1.5e4});
  const Vec6 mm(1e3, 1e3, 1e3, 1, 1, 1);
  const Mat6 in_mm = mm.asDiagonal() * C * mm.asDiagonal() * 1e-6;
  BOOST_TEST(!spring_from_compliance(C, "m").rotated);
  BOOST_TEST(!spring_from_compliance(in_mm, "mm").rotated);
}

BOOST_AUTO_TEST_SUITE_END()
