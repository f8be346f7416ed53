// SPDX-License-Identifier: MIT
#include "stiffmap/kinematics/pull.hpp"

#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double no_length = 1e-12;  // m: a line of no direction
constexpr double corner = 1e-12;     // of the length: a cable at its free length yields as if it were taut

/// Compliance of a real element at its free length.
double compliance_of(const NodeSpring& s, double free) {
  if (!s.winch) return 1 / s.stiffness;
  const Winch& w = *s.winch;
  double c = s.stiffness > 0 ? 1 / s.stiffness : 0;
  if (w.elasticity > 0) c += (std::max(free, 0.0) + w.lead_factor * w.lead) / w.elasticity;
  return c / w.factor;
}

}  // namespace

CableLine cable_line(const Vec3& anchor, const Vec3& axis, double radius, const Vec3& point) {
  CableLine out;
  const Vec3 d = point - anchor;
  if (radius == 0) {
    out.length = d.norm();
    if (out.length < no_length) return out;
    out.along = d / out.length;
    out.bend = (Mat3::Identity() - out.along * out.along.transpose()) / out.length;
    return out;
  }
  const double height = d.dot(axis);
  const Vec3 across = d - height * axis;
  const double out_of_axis = across.norm();
  const Vec3 e = across / out_of_axis, side = axis.cross(e);
  const double in_plane = out_of_axis - radius;
  const double straight = std::sqrt(in_plane * in_plane + height * height - radius * radius);
  const double angle = std::atan2(in_plane, height) + std::atan2(radius, straight);
  const double s = std::sin(angle), c = std::cos(angle);
  const Vec3 n = c * e - s * axis;
  out.length = radius * angle + straight;
  out.along = s * e + c * axis;
  out.bend = n * n.transpose() / straight + s / out_of_axis * side * side.transpose();
  return out;
}

Pull pull_of(const NodeSpring& s, double length, double free, bool slack_too) {
  Pull out;
  const double stretch = length - free;
  const bool one_sided = (s.tension_only || s.winch) && !slack_too;
  if (one_sided && !(stretch > -corner * length)) return out;
  out.stiffness = s.winch ? 1 / compliance_of(s, free) : s.stiffness;
  if (one_sided && !(stretch > 0)) return out;
  out.force = out.stiffness * stretch;
  out.energy = 0.5 * out.force * stretch;
  return out;
}

CableLine line_of(const NodeSpring& s, const Vec3& point) {
  if (!s.winch) return cable_line(s.anchor, Vec3::UnitZ(), 0, point);
  return cable_line(s.anchor + s.winch->anchor_error, s.winch->axis, s.winch->radius, point);
}

double free_length(const NodeSpring& s, const VecX& x) { return s.winch ? x[s.coordinate] : s.length; }

Vec3 force_of(const NodeSpring& s, const Frames& actual, const VecX& x, Vec3& point) {
  point = pulled_point(s, actual);
  const CableLine line = line_of(s, point);
  return -pull_of(s, line.length, free_length(s, x)).force * line.along;
}

/// L = l + T (l + lead)/EA + T/k, with T the pretension.
double commanded_length(const NodeSpring& s, double length) {
  const Winch& w = *s.winch;
  double stretch = s.stiffness > 0 ? w.pretension / s.stiffness : 0;
  if (w.elasticity > 0) stretch += w.pretension * w.lead / w.elasticity;
  return (length - stretch) * commanded_slope(s);
}

double commanded_slope(const NodeSpring& s) {
  const Winch& w = *s.winch;
  return w.elasticity > 0 ? 1 / (1 + w.pretension / w.elasticity) : 1.0;
}

void wind(const Mechanism& m, const Frames& nominal, VecX& x) {
  for (const Index i : m.cables) {
    const NodeSpring& s = m.external_springs[at(i)];
    const Winch& w = *s.winch;
    x[s.coordinate] =
        commanded_length(s, cable_line(s.anchor, w.axis, w.radius, nominal.point(s.node, s.offset)).length);
  }
}

}  // namespace stiffmap
