// SPDX-License-Identifier: MIT
// Force elements outside the legs: straight springs and cables between a point of the machine and an anchor in the
// base (theory B1-B4).
#pragma once

#include "stiffmap/kinematics/kinematics.hpp"

namespace stiffmap {

/// The way of a cable from where it enters its guide to a point, with its derivatives by the point.
struct CableLine {
  double length = 0;          ///< the arc on the pulley and the straight piece
  Vec3 along = Vec3::Zero();  ///< unit vector of the straight piece, towards the point: gradient of the length
  Mat3 bend = Mat3::Zero();   ///< second derivative of the length
};

/// Shortest way from `anchor` to `point` over a pulley of `radius` that turns about `axis` through the anchor and that
/// the cable enters along it (theory B2); an eye where the radius is zero. A point inside the pulley gives NaN.
CableLine cable_line(const Vec3& anchor, const Vec3& axis, double radius, const Vec3& point);

/// What an element does at one free length.
struct Pull {
  double force = 0;      ///< tension is positive
  double stiffness = 0;  ///< its derivative by the length of the way
  double energy = 0;
};

/// By the law of the real element (theory B1): tension only if it is a cable or says so. `slack_too`: also where it
/// is slack, as a spring that pushes.
Pull pull_of(const NodeSpring& s, double length, double free_length, bool slack_too = false);

/// The line of an element to a point of the real machine, and the free length at coordinates x.
CableLine line_of(const NodeSpring& s, const Vec3& point);
double free_length(const NodeSpring& s, const VecX& x);
/// The point of the real machine.
inline Vec3 pulled_point(const NodeSpring& s, const Frames& f) {
  return f.point(s.node, s.winch ? Vec3(s.offset + s.winch->point_error) : s.offset);
}

/// Force on the machine at its point, zero where the element is slack.
Vec3 force_of(const NodeSpring& s, const Frames& actual, const VecX& x, Vec3& point);

/// The free length that the controller commands where the way is `length` long (theory B3), and its slope.
double commanded_length(const NodeSpring& s, double length);
double commanded_slope(const NodeSpring& s);

/// Winch coordinates at nominal frames.
void wind(const Mechanism& m, const Frames& nominal, VecX& x);

}  // namespace stiffmap
