// SPDX-License-Identifier: MIT
// The hot loop of the fast path allocates nothing: every call of malloc (and of operator new, which ends
// there) is counted.
#include <atomic>
#include <boost/test/unit_test.hpp>
#include <cstdlib>
#include <vector>

#include "../../cpp/kernels/dispatch.hpp"
#include "machines.hpp"
#include "stiffmap/solve/batch.hpp"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
namespace {
std::atomic<long> calls{0};
}

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
__attribute__((visibility("default"))) void* malloc(std::size_t n) { return ++calls, __libc_malloc(n); }
__attribute__((visibility("default"))) void* calloc(std::size_t k, std::size_t n) {
  return ++calls, __libc_calloc(k, n);
}
__attribute__((visibility("default"))) void* realloc(void* p, std::size_t n) { return ++calls, __libc_realloc(p, n); }
__attribute__((visibility("default"))) void* aligned_alloc(std::size_t a, std::size_t n) {
  return ++calls, __libc_memalign(a, n);
}
}

using namespace stiffmap;
using namespace stiffmap::test;

namespace {

template <class Work>
long counted(Work&& work) {
  const long before = calls;
  work();
  return calls - before;
}

/// Poses inside the workspace of the Orthoglide, room for their answers, and the plan.
struct Batch {
  Mechanism machine = Orthoglide().build();
  FastPlan plan{machine, Vec3::Constant(-0.2), Vec3::Constant(0.3)};
  std::vector<double> position, rotation, wrench, displacement, stiffness;
  std::vector<std::uint8_t> status, done;
  std::vector<std::uint32_t> flags;
  std::vector<std::int32_t> iterations;

  explicit Batch(std::size_t n)
      : position(3 * n),
        rotation(9 * n),
        wrench(6 * n, 40.0),
        displacement(6 * n),
        stiffness(36 * n),
        status(n),
        done(n),
        flags(n),
        iterations(n) {
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < 3; ++k) {
        position[3 * i + k] = -0.15 + 0.4 * static_cast<double>((7 * i + 3 * k * i) % 11) / 10;
        rotation[9 * i + 4 * k] = 1;
      }
  }

  BatchInput input() const {
    BatchInput in;
    in.count = static_cast<Index>(status.size());
    in.position = position.data();
    in.rotation = rotation.data();
    in.wrench = wrench.data();
    in.load_points = {{machine.tip, Vec3::Zero(), LoadType::dead}};
    in.read_points = {0};
    return in;
  }

  long second_call() {
    const BatchInput in = input();
    BatchOutput out;
    out.displacement = displacement.data();
    out.stiffness = stiffness.data();
    out.status = status.data();
    const auto solve = [&] { solve_batch(machine, &plan, in, {}, 1, out); };
    solve();
    return counted(solve);
  }
};

}  // namespace

BOOST_AUTO_TEST_SUITE(allocations)

BOOST_AUTO_TEST_CASE(the_counter_counts) {
  void* volatile kept = nullptr;
  BOOST_TEST(counted([&] { kept = std::malloc(100); }) == 1);
  std::free(kept);
  BOOST_TEST(counted([] {
               VecX v = VecX::Zero(50);
               asm volatile("" : : "g"(v.data()) : "memory");
             }) == 1);
}

BOOST_AUTO_TEST_CASE(kernels_allocate_nothing) {
  Batch b(64);
  const KernelTable& table = kernel();
  const Program& program = b.plan.program();
  std::vector<char> scratch(static_cast<std::size_t>(table.scratch_size(&program)));
  KernelInput in{};
  in.count = 64;
  in.position = b.position.data();
  in.rotation = b.rotation.data();
  in.wrench = b.wrench.data();
  in.max_iterations = 16;
  in.tolerance = 1e-10;
  KernelOutput out{};
  out.displacement = b.displacement.data();
  out.stiffness = b.stiffness.data();
  out.done = b.done.data();
  out.flags = b.flags.data();
  out.iterations = b.iterations.data();
  BOOST_TEST(counted([&] { table.run(&program, &in, &out, 0, in.count, scratch.data()); }) == 0);
  for (std::uint8_t d : b.done) BOOST_TEST(d == 1);
}

BOOST_AUTO_TEST_CASE(a_batch_allocates_as_often_for_one_pose_as_for_many) {
  const long one = Batch(1).second_call(), many = Batch(2000).second_call();
  BOOST_TEST(one == many);
  BOOST_TEST(one < 10);
}

BOOST_AUTO_TEST_SUITE_END()
#endif
