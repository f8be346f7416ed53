// SPDX-License-Identifier: MIT
// Many poses at once: plain arrays in, plain arrays out, on all threads.
#pragma once

#include "stiffmap/common/answers.hpp"
#include "stiffmap/plan/fast_plan.hpp"
#include "stiffmap/solve/solve.hpp"

namespace stiffmap {

namespace flag {
/// The fast path was asked for and left the pose to the reference path. Bits below: types.hpp.
inline constexpr std::uint32_t reference_path = 1u << 13;
}  // namespace flag

/// Row-major inputs of `count` poses.
struct BatchInput {
  Index count = 0;
  const double* position = nullptr;  ///< count x 3
  const double* rotation = nullptr;  ///< count x 9, or one for all
  const double* wrench = nullptr;    ///< count x load points x 6, or one for all
  bool one_rotation = false, one_wrench = false;
  const double* closed = nullptr;  ///< count x coordinates already closed at the poses; null: found by closure
  std::vector<LoadPoint> load_points;
  std::vector<Index> read_points;
  Vec3 gravity = Vec3::Zero();
  std::vector<const FastPlan*> variants;  ///< plans of the same machine with a parameter moved
  void (*poll)() = nullptr;               ///< called now and then on the calling thread; throws to stop the batch

  /// Checks rows of numbers and points to them, after `count` and the points.
  void take(const Mechanism& m, const Rows& positions, const Rows& rotations, const Rows& wrenches, const Rows& known);

  /// Of pose i: its commanded frame, and a load's wrench.
  Pose commanded(Index i) const {
    const double* const R = rotation + (one_rotation ? 0 : 9 * i);
    return {Eigen::Map<const Vec3>(position + 3 * i), Eigen::Map<const Row3>(R)};
  }
  Eigen::Map<const Vec6> load(Index i, Index k) const {
    const Index loads = static_cast<Index>(load_points.size());
    return Eigen::Map<const Vec6>(wrench + 6 * ((one_wrench ? 0 : i * loads) + k));
  }
};

/// Row-major outputs; null pointers are not written.
struct BatchOutput {
  double* displacement = nullptr;         ///< count x read points x 6
  double* stiffness = nullptr;            ///< count x 36
  double* compliance = nullptr;           ///< count x 36
  double* free_twists = nullptr;          ///< count x 36
  std::uint8_t* nothing_free = nullptr;   ///< 1 instead of NaN in `free_twists`, where this is given
  double* effort = nullptr;               ///< count x drives
  double* leg_wrench = nullptr;           ///< count x legs x 6
  double* coordinates = nullptr;          ///< count x coordinates
  std::uint8_t* indeterminate = nullptr;  ///< count x coordinates
  std::uint8_t* status = nullptr;
  std::uint32_t* flags = nullptr;
  std::int32_t* iterations = nullptr;
  double* variants = nullptr;  ///< count x variants x 6; NaN where the reference path was taken
};

/// The SIMD kernels for every pose that they can do, the dense reference path for the rest, and for all where there is
/// no plan; the result of a pose depends on nothing but the pose.
void solve_batch(const Mechanism& m, const FastPlan* plan, const BatchInput& in, const SolveOptions& options,
                 int threads, const BatchOutput& out);

}  // namespace stiffmap
