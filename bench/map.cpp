// SPDX-License-Identifier: MIT
// One machine over a grid of poses, and two threads against one.
#include "../cpp/kernels/dispatch.hpp"
#include "allocations.hpp"
#include "commands.hpp"
#include "workload.hpp"

namespace stiffmap::bench {

Report map(const Options& o) {
  const bool fast = o.method == "fast";
  Workload work(machine(o.machine), o.grid, o.force);
  work.solve(fast, o.threads);
  const long before = allocations();
  work.solve(fast, o.threads);
  const long used = allocations() - before;
  std::vector<double> times;
  for (int i = 0; i < o.repeat; ++i) times.push_back(seconds([&] { work.solve(fast, o.threads); }));
  const double n = static_cast<double>(work.count());
  const Summary s = summary(times);
  Report out;
  out.text("machine", o.machine);
  out.text("method", o.method);
  out.text("level", kernel().level);
  out.number("threads", o.threads);
  out.number("force_N", o.force);
  out.number("poses", n);
  out.number("poses_per_s", n / s.median);
  out.timing("us_per_pose_and_thread", summary(times, 1e6 * o.threads / n));
  out.number("iterations", work.mean_iterations());
  out.number("mean_deflection_m", work.mean_deflection());
  out.number("failed", static_cast<double>(work.failed()));
  out.number("left_to_reference", fast ? static_cast<double>(work.left_over()) : n);
  out.number("allocations_per_call", static_cast<double>(used));
  return out;
}

Report scaling(const Options& o) {
  Workload work(machine(o.machine), o.grid, o.force);
  work.solve(true, 2);
  std::vector<double> one, two, ratio;
  for (int i = 0; i < o.repeat; ++i) {
    one.push_back(seconds([&] { work.solve(true, 1); }));
    two.push_back(seconds([&] { work.solve(true, 2); }));
    ratio.push_back(one.back() / two.back());
  }
  const double n = static_cast<double>(work.count());
  Report out;
  out.text("machine", o.machine);
  out.number("poses", n);
  out.number("pairs", o.repeat);
  out.timing("one_thread_us_per_pose", summary(one, 1e6 / n));
  out.timing("two_threads_us_per_pose", summary(two, 1e6 / n));
  out.timing("ratio", summary(ratio));
  return out;
}

}  // namespace stiffmap::bench
