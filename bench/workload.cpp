// SPDX-License-Identifier: MIT
#include "workload.hpp"

#include "../cpp/kernels/dispatch.hpp"

namespace stiffmap::bench {

Workload::Workload(Case machine, int n, double force)
    : case_(std::move(machine)),
      plan_(std::make_unique<FastPlan>(case_.mechanism, case_.low, case_.high)),
      count_(static_cast<Index>(n) * n * n) {
  // As in the published comparisons: 1/18 of the box away from its faces.
  const auto coordinate = [&](int axis, int i) {
    const double margin = (case_.high[axis] - case_.low[axis]) / 18;
    const double low = case_.low[axis] + margin, high = case_.high[axis] - margin;
    return n > 1 ? low + (high - low) * i / (n - 1) : 0.5 * (low + high);
  };
  const Mat3& home = case_.mechanism.home.R;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) {
        position_.insert(position_.end(), {coordinate(0, i), coordinate(1, j), coordinate(2, k)});
        for (int r = 0; r < 3; ++r) rotation_.insert(rotation_.end(), {home(r, 0), home(r, 1), home(r, 2)});
        wrench_.insert(wrench_.end(), {0, 0, force, 0, 0, 0});
      }
  const auto size = static_cast<std::size_t>(count_);
  displacement_.resize(6 * size);
  stiffness_.resize(36 * size);
  status_.resize(size);
  iterations_.resize(size);
  in_.count = count_;
  in_.position = position_.data();
  in_.rotation = rotation_.data();
  in_.wrench = wrench_.data();
  in_.load_points = {{case_.mechanism.tip, Vec3::Zero(), LoadType::dead}};
  in_.read_points = {0};
  out_.displacement = displacement_.data();
  out_.stiffness = stiffness_.data();
  out_.status = status_.data();
  out_.iterations = iterations_.data();
}

void Workload::solve(bool fast, int threads) {
  solve_batch(mechanism(), fast ? &plan() : nullptr, in_, {}, threads, out_);
}

Index Workload::failed() const {
  Index n = 0;
  for (std::uint8_t s : status_) n += s != static_cast<std::uint8_t>(Status::converged);
  return n;
}

double Workload::mean_iterations() const {
  double sum = 0;
  for (std::int32_t i : iterations_) sum += i;
  return sum / static_cast<double>(count_);
}

double Workload::mean_deflection() const {
  double sum = 0;
  for (Index i = 0; i < count_; ++i)
    if (status_[static_cast<std::size_t>(i)] == 0) sum += Eigen::Map<const Vec3>(displacement_.data() + 6 * i).norm();
  return sum / static_cast<double>(count_ - failed());
}

Index Workload::left_over() const {
  if (!plan().available() || !plan().program().closes) return count_;
  const KernelTable& table = kernel();
  std::vector<char> scratch(static_cast<std::size_t>(table.scratch_size(&plan().program())));
  std::vector<double> displacement(displacement_.size());
  std::vector<std::uint8_t> done(status_.size());
  std::vector<std::uint32_t> flags(status_.size());
  KernelInput in{};
  in.count = count_;
  in.position = in_.position;
  in.rotation = in_.rotation;
  in.wrench = in_.wrench;
  in.max_iterations = 16;
  in.tolerance = EquilibriumOptions{}.tolerance;
  KernelOutput out{};
  out.displacement = displacement.data();
  out.done = done.data();
  out.flags = flags.data();
  table.run(&plan().program(), &in, &out, 0, count_, scratch.data());
  Index n = 0;
  for (std::uint8_t d : done) n += d == 0;
  return n;
}

}  // namespace stiffmap::bench
