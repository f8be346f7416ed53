// SPDX-License-Identifier: MIT
// Peak rate and the passes of every instruction-set level that this processor has.
#include <algorithm>

#include "../cpp/kernels/dispatch.hpp"
#include "commands.hpp"
#include "count.hpp"
#include "passes.hpp"
#include "workload.hpp"

extern "C" void stiffmap_passes_base(stiffmap::bench::PassTable*);
#ifdef STIFFMAP_X86_LEVELS
extern "C" void stiffmap_passes_v3(stiffmap::bench::PassTable*);
extern "C" void stiffmap_passes_v4(stiffmap::bench::PassTable*);
#endif

namespace stiffmap::bench {
namespace {

/// A level's code, the filling of its table too, runs only where the processor has the level.
std::vector<PassTable> tables() {
  const std::vector<std::string> usable = kernel_levels();
  std::vector<PassTable> out;
  const auto add = [&](const char* level, void (*entry)(PassTable*)) {
    if (std::count(usable.begin(), usable.end(), level)) entry(&out.emplace_back());
  };
  add("base", &stiffmap_passes_base);
#ifdef STIFFMAP_X86_LEVELS
  add("v3", &stiffmap_passes_v3);
  add("v4", &stiffmap_passes_v4);
#endif
  return out;
}

struct Outputs {
  std::vector<double> displacement, stiffness;
  std::vector<std::uint8_t> done;
  std::vector<std::uint32_t> flags;
  std::vector<std::int32_t> iterations;
  explicit Outputs(Index n) {
    const auto size = static_cast<std::size_t>(n);
    displacement.resize(6 * size);
    stiffness.resize(36 * size);
    done.resize(size);
    flags.resize(size);
    iterations.resize(size);
  }
  KernelOutput pointers() {
    KernelOutput out{};
    out.displacement = displacement.data();
    out.stiffness = stiffness.data();
    out.done = done.data();
    out.flags = flags.data();
    out.iterations = iterations.data();
    return out;
  }
};

KernelInput kernel_input(const BatchInput& in) {
  KernelInput k{};
  k.count = in.count;
  k.position = in.position;
  k.rotation = in.rotation;
  k.wrench = in.wrench;
  k.max_iterations = 16;
  k.tolerance = EquilibriumOptions{}.tolerance;
  return k;
}

}  // namespace

Report passes(const Options& o) {
  Workload work(machine(o.machine), std::min(o.grid, 8), o.force);
  const Program& program = work.plan().program();
  const KernelInput in = kernel_input(work.input());
  Outputs room(work.count());
  const KernelOutput out = room.pointers();
  Report report;
  report.text("machine", o.machine);
  report.number("force_N", o.force);
  const Counts counts = count_operations(program, in, out);
  for (int k = 0; k < pass_count; ++k) report.number(std::string("operations_") + pass_names[k], counts.operations[k]);
  for (const PassTable& table : tables()) {
    std::vector<char> scratch(static_cast<std::size_t>(table.scratch_size(&program)));
    double seconds[pass_count] = {};
    table.measure(&program, &in, &out, scratch.data(), o.repeat, seconds);
    const std::string level = table.level;
    for (int k = 0; k < pass_count; ++k) report.number(level + "_" + pass_names[k] + "_ns", 1e9 * seconds[k]);
    report.number(level + "_iteration_gflops", counts.operations[iteration] / seconds[iteration] / 1e9);
    report.number(level + "_block_gflops", counts.operations[block] / seconds[block] / 1e9);
    report.number(level + "_peak_gflops", table.peak() / 1e9);
  }
  return report;
}

Report peak(const Options& o) {
  Report report;
  for (const PassTable& table : tables()) {
    std::vector<double> rates;
    for (int i = 0; i < o.repeat; ++i) rates.push_back(table.peak());
    report.timing(std::string(table.level) + "_gflops", summary(rates, 1e-9));
  }
  return report;
}

}  // namespace stiffmap::bench
