// SPDX-License-Identifier: MIT
#include <atomic>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <vector>

#include "machines.hpp"
#include "numeric.hpp"
#include "stiffmap/common/parallel.hpp"
#include "stiffmap/solve/batch.hpp"

using namespace stiffmap;
using namespace stiffmap::test;

namespace {

struct Answer {
  std::vector<double> displacement, stiffness, compliance, effort, leg_wrench;
  std::vector<std::uint8_t> status;
};

Answer run(const Mechanism& m, const std::vector<double>& position, int threads, const FastPlan* plan = nullptr) {
  const std::size_t n = position.size() / 3;
  std::vector<double> rotation(9 * n), wrench(6 * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) rotation[9 * i + static_cast<std::size_t>(4 * k)] = 1;
    wrench[6 * i] = 300;
    wrench[6 * i + 4] = 10;
  }
  BatchInput in;
  in.count = static_cast<Index>(n);
  in.position = position.data();
  in.rotation = rotation.data();
  in.wrench = wrench.data();
  in.load_points = {{m.tip, Vec3::Zero(), LoadType::dead}};
  in.read_points = {0};
  Answer a{std::vector<double>(6 * n), std::vector<double>(36 * n), std::vector<double>(36 * n),
           std::vector<double>(3 * n), std::vector<double>(18 * n), std::vector<std::uint8_t>(n)};
  BatchOutput out;
  out.displacement = a.displacement.data();
  out.stiffness = a.stiffness.data();
  out.compliance = a.compliance.data();
  out.effort = a.effort.data();
  out.leg_wrench = a.leg_wrench.data();
  out.status = a.status.data();
  solve_batch(m, plan, in, {}, threads, out);
  return a;
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(batch)

BOOST_AUTO_TEST_CASE(threads_do_not_change_a_bit) {
  const Mechanism m = Orthoglide().build();
  Random random(1);
  std::vector<double> position(3 * 34);                       // three chunks
  for (double& p : position) p = random.uniform(-0.2, 0.45);  // some out of reach
  const Answer one = run(m, position, 1), seven = run(m, position, 7);
  BOOST_TEST(one.status == seven.status, boost::test_tools::per_element());
  BOOST_TEST(same_bits(one.displacement, seven.displacement));
  BOOST_TEST(same_bits(one.stiffness, seven.stiffness));
  BOOST_TEST(same_bits(one.compliance, seven.compliance));
  BOOST_TEST(same_bits(one.effort, seven.effort));
  BOOST_TEST(same_bits(one.leg_wrench, seven.leg_wrench));
}

/// Under the thread sanitizer (preset `threads`): the passes of one batch, and callers that share plan and kernels.
BOOST_AUTO_TEST_CASE(kernels_on_many_threads_by_several_callers) {
  const Mechanism m = Orthoglide().build();
  std::vector<double> position(3 * 600);  // half of them beyond the box, some out of reach
  for (std::size_t i = 0; i < position.size(); ++i)
    position[i] = -0.2 + 0.5 * std::fmod(0.61803398875 * static_cast<double>(i), 1.0);
  std::vector<Answer> answers(3);
  std::vector<std::thread> callers;
  const FastPlan shared(m, Vec3::Constant(-0.1), Vec3::Constant(0.2));
  for (std::size_t k = 0; k < answers.size(); ++k)
    callers.emplace_back([&, k] {
      const FastPlan own(m, Vec3::Constant(-0.1), Vec3::Constant(0.2));
      answers[k] = run(m, position, static_cast<int>(k) + 1, k == 1 ? &own : &shared);
    });
  for (std::thread& t : callers) t.join();
  for (const Answer& a : answers) {
    BOOST_CHECK(same_bits(a.displacement, answers[0].displacement));
    BOOST_CHECK(same_bits(a.stiffness, answers[0].stiffness));
    BOOST_CHECK(a.status == answers[0].status);
  }
}

BOOST_AUTO_TEST_CASE(earlier_poses_leave_no_trace) {
  const Mechanism m = Orthoglide().build();
  Random random(2);
  std::vector<double> position(3 * 12), backwards;
  for (double& p : position) p = random.uniform(-0.2, 0.45);
  for (std::size_t i = 12; i-- > 0;) backwards.insert(backwards.end(), &position[3 * i], &position[3 * i] + 3);
  const Answer a = run(m, position, 1), b = run(m, backwards, 1);
  for (std::size_t i = 0; i < 12; ++i)
    BOOST_TEST(std::memcmp(&a.stiffness[36 * i], &b.stiffness[36 * (11 - i)], 36 * sizeof(double)) == 0);
}

BOOST_AUTO_TEST_CASE(no_pose_is_an_empty_answer) {
  const Mechanism m = Orthoglide().build();
  BOOST_TEST(run(m, {}, 3).displacement.empty());
}

BOOST_AUTO_TEST_CASE(every_item_is_visited_once) {
  for (int threads : {1, 2, 7}) {
    std::vector<std::atomic<int>> visits(101);
    parallel_chunks(101, 4, threads, [&](int, long begin, long end) {
      for (long i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(i)];
    });
    for (const auto& v : visits) BOOST_TEST(v == 1);
  }
}

BOOST_AUTO_TEST_CASE(an_exception_in_a_thread_reaches_the_caller) {
  const auto work = [](int, long begin, long) {
    if (begin == 8) throw std::runtime_error("chunk 8");
  };
  BOOST_CHECK_THROW(parallel_chunks(40, 4, 3, work), std::runtime_error);
}

BOOST_AUTO_TEST_SUITE_END()
