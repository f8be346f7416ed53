// SPDX-License-Identifier: MIT
// Compiled against a copy of cpp/kernels in which lanes.hpp is the counting one.
#include "count.hpp"

#include <vector>

#include "kernel.cpp"

namespace stiffmap::kernel {
namespace {

template <class Work>
double counted(Work&& work) {
  const long before = operations;
  work();
  return static_cast<double>(operations - before);
}

void count_pose(const Program& P, Block& b, Scratch& s, double* out) {
  out[bench::closure] += counted([&] { b.read(); });
  out[bench::block] += counted([&] { b.run(); });
  const double f = __builtin_sqrt(P.stiffness), g = f * P.length;
  Elimination e{P, s, {}, splat(1e300), {f, f, f, g, g, g}};
  Newton n{P, b.in, s, e, b.load, {}};
  n.turning.read(P, b.in, b.command.R, [&](int lane) { return b.pose(lane); });
  Frame tip = Closing::base_frame();
  V3 at;
  V6 F = b.load, c;
  Sym6 K;
  V C[6][6], zero[6];
  out[bench::laws] += counted([&] { n.laws.evaluate(false); });
  out[bench::frames] += counted([&] { walk<Build::actual>(P, P.chains[P.root], s.x, tip, s); });
  at = tip.p;
  out[bench::wrenches] += counted([&] { wrenches(e, P.chains[P.root], F, at); });
  for (int i = 0; i < P.op_count; ++i)
    if (P.ops[i].kind == OpKind::spring)
      out[bench::elements] += counted([&] { spring_tangent(e, P.ops[i], s.stiff[P.ops[i].slot], K, c); });
  out[bench::elimination] += counted([&] { n.K = tangent(e, P.chains[P.root], V3{}, b.load, tip.p).K; });
  out[bench::platform] += counted([&] {
    n.dense(n.K, C);
    invert(e, C);
  });
  out[bench::back] += counted([&] { back(e, P.chains[P.root], get(zero), tip.p, V3{}, M{}); });
  n.tip = tip;
  n.point = tip.p;
  out[bench::output] += counted([&] { b.write(M{-1}, n, C, C, splat(1), splat(1)); });
}

}  // namespace
}  // namespace stiffmap::kernel

stiffmap::bench::Counts stiffmap::bench::count_operations(const Program& P, const KernelInput& in,
                                                          const KernelOutput& out) {
  using namespace stiffmap::kernel;
  std::vector<char> scratch(static_cast<std::size_t>(scratch_size(&P)));
  Scratch s = lay_out(P, scratch.data(), nullptr);
  Counts counts{};
  for (std::int64_t i = 0; i < in.count; ++i) {
    kernel::Block b{{P, in, out, s, i, 1}};
    count_pose(P, b, s, counts.operations);
  }
  for (double& n : counts.operations) n /= static_cast<double>(in.count);
  counts.operations[elimination] -= counts.operations[elements];
  for (Pass p : {laws, frames, bench::wrenches, elements, elimination, platform, back})
    counts.operations[iteration] += counts.operations[p];
  return counts;
}
