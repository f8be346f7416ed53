// SPDX-License-Identifier: MIT
// The basic types, and the one place that states the order of wrenches and twists.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace stiffmap {

using Index = Eigen::Index;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
/// Wrench (force, moment) or twist (translation, rotation): linear part first, angular second.
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Mat3X = Eigen::Matrix<double, 3, Eigen::Dynamic>;
using VecX = Eigen::VectorXd;
using MatX = Eigen::MatrixXd;

/// How a pose ended.
enum class Status : std::uint8_t {
  converged = 0,
  unreachable = 1,  ///< the closure has no solution
  singular = 2,     ///< platform directions without stiffness, or an undetermined configuration
  unstable = 3,     ///< an equilibrium whose energy is not a minimum
  not_converged = 4,
};

/// What else is to be known of a pose; bits.
namespace flag {
inline constexpr std::uint32_t leg_singular = 1u << 0;       ///< a leg lost rank, the platform did not
inline constexpr std::uint32_t free_spin = 1u << 1;          ///< a passive coordinate turns without effect
inline constexpr std::uint32_t platform_singular = 1u << 2;  ///< see free_twists
inline constexpr std::uint32_t internal_wrench_undetermined = 1u << 3;
inline constexpr std::uint32_t configuration_undetermined = 1u << 4;
inline constexpr std::uint32_t rigid_direction = 1u << 5;  ///< infinite stiffness: compliance only
inline constexpr std::uint32_t joint_limit = 1u << 6;
inline constexpr std::uint32_t drive_range = 1u << 7;
inline constexpr std::uint32_t drive_force = 1u << 8;
inline constexpr std::uint32_t nonconservative = 1u << 9;     ///< stability by determinant signs
inline constexpr std::uint32_t branch_unverified = 1u << 10;  ///< reached without continuation
inline constexpr std::uint32_t free_play = 1u << 11;          ///< a gap is open: no stiffness inside it
inline constexpr std::uint32_t load_stepped = 1u << 12;       ///< full load was not reached in one step
inline constexpr std::uint32_t gimbal_lock = 1u << 14;        ///< axes of a ball joint (nearly) coincide
inline constexpr std::uint32_t slack = 1u << 15;              ///< a cable carries nothing
}  // namespace flag

/// Dimensionless threshold of every rank decision, on matrices scaled to length and stiffness.
inline constexpr double rank_threshold = 1e-7;
/// Of a scaled pivot: below, look closer with a rank-revealing factorisation.
inline constexpr double pivot_alarm = 1e-5;
/// Of a pivot of the scaled elastic block: below, the tangent is taken as a whole.
inline constexpr double safe_pivot = 1e-3;

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// An index of Eigen's as one of the standard library's.
constexpr std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace stiffmap
