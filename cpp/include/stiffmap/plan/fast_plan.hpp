// SPDX-License-Identifier: MIT
// A mechanism compiled to the plain program that the SIMD kernels run (docs/fast_path.md).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stiffmap/closure/closure.hpp"

namespace stiffmap {

struct Program;
struct FastPlanData;

/// Immutable and shared by all threads. `missing` says why a mechanism has to take the reference path.
class FastPlan {
 public:
  /// `low`, `high`: box of tip positions where poses are expected; empty: none is known. `grid_nodes`: along each edge
  /// of it closures are prepared as starts.
  FastPlan(const Mechanism& m, const Vec3& low, const Vec3& high, int grid_nodes = 8);
  ~FastPlan();
  FastPlan(const FastPlan&) = delete;
  FastPlan& operator=(const FastPlan&) = delete;

  bool available() const { return missing_.empty(); }
  const std::string& missing() const { return missing_; }
  /// Under gravity weights turn spins (theory C10); the kernels can where the program has one for what hangs.
  bool heavy_spins() const { return heavy_spins_; }
  /// This held spin is one of them, and the kernels turn it.
  bool hangs(Index coordinate) const;
  const Program& program() const;

  /// Coordinates of the nearest node of the grid of closure starts; false outside the box or where no node is within
  /// reach.
  bool nearest_start(const Mechanism& m, const Vec3& position, VecX& x) const;

 private:
  std::unique_ptr<FastPlanData> data_;
  std::string missing_;
  bool heavy_spins_ = false;
};

}  // namespace stiffmap
