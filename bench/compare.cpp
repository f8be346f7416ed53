// SPDX-License-Identifier: MIT
// Fast path, reference path and the yardstick (one scalar 6x6 congruence and inverse) in one run.
#include <Eigen/LU>
#include <cmath>

#include "commands.hpp"
#include "workload.hpp"

namespace stiffmap::bench {

double congruence_and_inverse() {
  constexpr int times = 20000;
  Mat6 J = Mat6::Identity(), C = orthoglide_bar(), K = Mat6::Zero();
  J(0, 5) = 0.3;
  J(1, 3) = -0.2;
  J(2, 4) = 0.1;
  const double t = seconds([&] {
    for (int i = 0; i < times; ++i) {
      J(0, 4) = 1e-6 * i;
      keep(J);
      K.noalias() = (J.transpose() * C * J).inverse();
      keep(K);
    }
  });
  return t / times;
}

Report compare(const Options& o) {
  Workload fast(machine(o.machine), o.grid, o.force), reference(machine(o.machine), o.grid > 8 ? 8 : o.grid, o.force);
  fast.solve(true, 1);
  reference.solve(false, 1);
  std::vector<double> tf, tr, tc, dense_ratio, unit_ratio;
  for (int i = 0; i < o.repeat; ++i) {
    tf.push_back(seconds([&] { fast.solve(true, 1); }) / static_cast<double>(fast.count()));
    tr.push_back(seconds([&] { reference.solve(false, 1); }) / static_cast<double>(reference.count()));
    tc.push_back(congruence_and_inverse());
    dense_ratio.push_back(tr.back() / tf.back());
    unit_ratio.push_back(tf.back() / fast.mean_iterations() / tc.back());
  }
  Report out;
  out.text("machine", o.machine);
  out.number("force_N", o.force);
  out.number("poses", static_cast<double>(fast.count()));
  out.number("iterations", fast.mean_iterations());
  out.number("mean_deflection_m", fast.mean_deflection());
  out.number("left_to_reference", static_cast<double>(fast.left_over()));
  out.timing("fast_us", summary(tf, 1e6));
  out.timing("reference_us", summary(tr, 1e6));
  out.timing("congruence_inverse_us", summary(tc, 1e6));
  out.timing("reference_over_fast", summary(dense_ratio));
  out.timing("iteration_over_congruence", summary(unit_ratio));
  return out;
}

namespace {

/// Slope of log y against log x.
double exponent(const std::vector<double>& x, const std::vector<double>& y) {
  const auto log = [](const std::vector<double>& v) {
    return Eigen::Map<const Eigen::ArrayXd>(v.data(), static_cast<Index>(v.size())).log().eval();
  };
  const Eigen::ArrayXd u = log(x) - log(x).mean(), w = log(y) - log(y).mean();
  return (u * w).sum() / (u * u).sum();
}

}  // namespace

Report serial_leg(const Options& o) {
  Report out;
  std::vector<double> springs, cost, step_cost;
  for (int n = 4; n <= 256; n *= 2) {
    Workload work(serial(n), 8, o.force);
    work.solve(true, 1);
    std::vector<double> times;
    for (int i = 0; i < o.repeat; ++i)
      times.push_back(seconds([&] { work.solve(true, 1); }) / static_cast<double>(work.count()));
    springs.push_back(n);
    cost.push_back(summary(times).median);
    step_cost.push_back(cost.back() / work.mean_iterations());
    const std::string name = "springs_" + std::to_string(n);
    out.timing(name + "_us", summary(times, 1e6));
    out.number(name + "_iterations", work.mean_iterations());
    out.number(name + "_left_to_reference", static_cast<double>(work.left_over()));
  }
  out.number("exponent", exponent(springs, cost));
  out.number("exponent_per_iteration", exponent(springs, step_cost));
  return out;
}

}  // namespace stiffmap::bench
