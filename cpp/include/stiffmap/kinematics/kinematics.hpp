// SPDX-License-Identifier: MIT
// Frames and Jacobian columns of a mechanism at given coordinates (theory C1, C4).
#pragma once

#include "stiffmap/kinematics/charts.hpp"

namespace stiffmap {

enum class Geometry : std::uint8_t { nominal, actual };

/// Frames of all nodes, and axis and origin of all coordinates, in base axes.
struct Frames {
  explicit Frames(const Mechanism& m) : pose(m.nodes.size()), axis(3, m.size()), origin(3, m.size()) {}
  std::vector<Pose> pose;
  Mat3X axis, origin;

  const Pose& at(Index node) const { return pose[static_cast<std::size_t>(node)]; }
  Vec3 point(Index node, const Vec3& offset) const { return at(node) * offset; }
};

/// `charts`: free balls numbered anew; null: all by their own axes.
void forward(const Mechanism& m, Geometry geometry, const VecX& x, Frames& out, const Charts* charts = nullptr);

/// Twist of a body point p per unit of coordinate j, seen from beyond the joint (theory C4).
inline Vec6 column(const Mechanism& m, const Frames& f, Index j, const Vec3& p) {
  Vec6 c;
  const Vec3 w = f.axis.col(j);
  if (m.coordinates[static_cast<std::size_t>(j)].type == JointType::prismatic) c << w, Vec3::Zero();
  else c << w.cross(p - f.origin.col(j)), w;
  return c;
}

/// Adds sign times the Jacobian of point p of `node` to `J`, whose columns are all coordinates.
template <class Matrix>
void add_jacobian(const Mechanism& m, const Frames& f, Index node, const Vec3& p, double sign, Matrix&& J) {
  for (Index j : m.path[static_cast<std::size_t>(node)]) J.col(j) += sign * column(m, f, j, p);
}

/// Rows of angles, three of each six, as lengths.
template <class Matrix>
void scale_angles(const Mechanism& m, Matrix&& rows) {
  for (Index i = 3; i < rows.rows(); i += 6) rows.middleRows(i, 3) *= m.length;
}

/// Twist that carries frame a to frame b: translation and rotation vector, base axes (theory C3).
Vec6 frame_error(const Pose& a, const Pose& b);

}  // namespace stiffmap
