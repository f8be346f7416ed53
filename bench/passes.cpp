// SPDX-License-Identifier: MIT
// The kernel's own translation unit with two more functions: its passes timed one by one, and the
// peak rate of the same vector type. Built once per instruction-set level, as the kernels are.
#include "passes.hpp"

#include "../cpp/kernels/kernel.cpp"
#include "statistics.hpp"

#ifndef STIFFMAP_PASSES
#define STIFFMAP_PASSES stiffmap_passes_base
#endif

namespace stiffmap::kernel {
namespace {

struct Timer {
  int repeats, lanes;
  double* out;
  /// The quickest of three runs: whoever interrupts one of them does not count.
  template <class Work>
  void operator()(bench::Pass pass, Work&& work) {
    double best = 1e300;
    for (int run = 0; run < 3; ++run) {
      const double t = bench::seconds([&] {
        for (int i = 0; i < repeats; ++i) {
          work();
          asm volatile("" : : : "memory");
        }
      });
      best = t < best ? t : best;
    }
    out[pass] += best / (repeats * lanes);
  }
};

void time_elements(const Program& P, Scratch& s, Elimination& e) {
  for (int i = 0; i < P.op_count; ++i) {
    const Op& op = P.ops[i];
    if (op.kind != OpKind::spring) continue;
    Sym6 K;
    V6 c;
    spring_tangent(e, op, s.stiff[op.slot], K, c);
    bench::keep(K);
    bench::keep(c);
  }
}

/// At the equilibrium that `b.run()` has left in the scratch.
void time_block(Block& b, const M usable, Timer& time) {
  const Program& P = b.P;
  Scratch& s = b.s;
  const double f = __builtin_sqrt(P.stiffness), g = f * P.length;
  Elimination e{P, s, {}, splat(1e300), {f, f, f, g, g, g}};
  Newton n{P, b.in, s, e, b.load, e.gravity};
  n.turning.read(P, b.in, b.command.R, [&](int lane) { return b.pose(lane); });
  time(bench::laws, [&] { n.laws.evaluate(false); });
  Frame tip;
  time(bench::frames, [&] {
    tip = Closing::base_frame();
    walk<Build::actual>(P, P.chains[P.root], s.x, tip, s);
  });
  V6 F;
  V3 at;
  time(bench::wrenches, [&] {
    F = b.load;
    at = tip.p;
    wrenches(e, P.chains[P.root], F, at);
  });
  time(bench::elements, [&] { time_elements(P, s, e); });
  time(bench::elimination, [&] { n.K = tangent(e, P.chains[P.root], V3{}, b.load, tip.p).K; });
  V K[6][6], C[6][6], x[6] = {};
  time(bench::platform, [&] {
    n.dense(n.K, C);
    invert(e, C);
    bench::keep(C);
  });
  n.dense(n.K, K);
  n.tip = tip;
  n.point = tip.p;
  time(bench::back, [&] { back(e, P.chains[P.root], get(x), tip.p, V3{}, M{}); });
  time(bench::output, [&] { b.write(usable, n, K, C, splat(1), splat(0)); });
  time(bench::iteration, [&] {
    n.laws.evaluate(false);
    n.linearize();
    n.dense(n.K, C);
    invert(e, C);
    bench::keep(C);
    back(e, P.chains[P.root], get(x), tip.p, V3{}, M{});
  });
}

void measure(const Program* P, const KernelInput* in, const KernelOutput* out, void* scratch, int repeats,
             double* seconds) {
  Scratch s = lay_out(*P, scratch, nullptr);
  std::int64_t blocks = 0;
  for (std::int64_t i = 0; i + W <= in->count; i += W, ++blocks) {
    Block b{{*P, *in, *out, s, i, W}};
    Timer time{repeats, W, seconds};
    M closed{};
    time(bench::closure, [&] { closed = b.read(); });
    time(bench::block, [&] { b.run(); });
    time_block(b, closed, time);
  }
  for (int k = 0; k < bench::pass_count; ++k) seconds[k] /= static_cast<double>(blocks);
  seconds[bench::elimination] -= seconds[bench::elements];
}

double peak() {
  constexpr int chains = 10, times = 2000000;
  V x[chains];
  for (int k = 0; k < chains; ++k) x[k] = splat(0.1 * k);
  V a = splat(0.999), b = splat(0.001);
  asm volatile("" : "+m"(a), "+m"(b));
  const double t = bench::seconds([&] {
    for (int i = 0; i < times; ++i)
#pragma GCC unroll 10
      for (int k = 0; k < chains; ++k) x[k] = x[k] * a + b;
  });
  bench::keep(x);
  return 2.0 * chains * times * W / t;
}

}  // namespace
}  // namespace stiffmap::kernel

extern "C" __attribute__((visibility("default"))) void STIFFMAP_PASSES(stiffmap::bench::PassTable* table) {
  *table = {STIFFMAP_LEVEL, stiffmap::kernel::W, &stiffmap::kernel::scratch_size, &stiffmap::kernel::measure,
            &stiffmap::kernel::peak};
}
