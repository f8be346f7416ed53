// SPDX-License-Identifier: MIT
// What each per-level library of the benchmark offers.
#pragma once

#include "program.hpp"

namespace stiffmap::bench {

/// Parts of the work on a block of poses. `elements` are tangents of the springs alone, `elimination`
/// the rest of the base-to-tip pass, `iteration` one Newton step as a whole, `block` everything.
enum Pass {
  closure,
  laws,
  frames,
  wrenches,
  elements,
  elimination,
  platform,
  back,
  output,
  iteration,
  block,
  pass_count
};

inline constexpr const char* pass_names[pass_count] = {
    "closure",           "laws",   "frames",    "wrenches", "elements", "elimination", "platform_inverse",
    "back_substitution", "output", "iteration", "block"};

struct PassTable {
  const char* level;
  int lanes;
  std::int64_t (*scratch_size)(const Program*);
  /// Adds seconds per pose of each pass over the poses of `in`, each block measured `repeats` times.
  void (*measure)(const Program*, const KernelInput*, const KernelOutput*, void* scratch, int repeats, double* seconds);
  double (*peak)();  ///< flop/s of independent multiply-adds in registers
};

}  // namespace stiffmap::bench
