// SPDX-License-Identifier: MIT
// A machine, a grid of poses under one force, and room for the answers: set up once, solved often.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "machines.hpp"
#include "stiffmap/solve/batch.hpp"

namespace stiffmap::bench {

class Workload {
 public:
  /// `n`^3 poses inside the box, a force along z at the TCP.
  Workload(Case machine, int n, double force);

  void solve(bool fast, int threads);
  Index count() const { return count_; }
  const Mechanism& mechanism() const { return case_.mechanism; }
  const FastPlan& plan() const { return *plan_; }
  const BatchInput& input() const { return in_; }
  double mean_iterations() const;
  double mean_deflection() const;  ///< m, of the poses with an answer
  Index failed() const;
  /// Poses that the kernels leave to the reference path.
  Index left_over() const;

 private:
  Case case_;
  std::unique_ptr<FastPlan> plan_;
  Index count_;
  std::vector<double> position_, rotation_, wrench_, displacement_, stiffness_;
  std::vector<std::uint8_t> status_;
  std::vector<std::int32_t> iterations_;
  BatchInput in_;
  BatchOutput out_;
};

}  // namespace stiffmap::bench
