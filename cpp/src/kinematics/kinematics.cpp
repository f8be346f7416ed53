// SPDX-License-Identifier: MIT
#include "stiffmap/kinematics/kinematics.hpp"

namespace stiffmap {

void forward(const Mechanism& m, Geometry geometry, const VecX& x, Frames& out, const Charts* charts) {
  const bool turned = charts && !charts->plain();
  out.pose[0] = Pose{};
  for (std::size_t i = 1; i < m.nodes.size(); ++i) {
    const Node& n = m.nodes[i];
    Pose& T = out.pose[i];
    T = out.pose[static_cast<std::size_t>(n.parent)] * (geometry == Geometry::nominal ? n.nominal : n.actual);
    if (n.coordinate < 0) continue;
    const Index ball = turned ? m.coordinates[at(n.coordinate)].ball : -1;
    if (ball >= 0 && m.balls[at(ball)].first == n.coordinate) T.R = (T.R * charts->turns[at(ball)].before).eval();
    const Vec3 w = T.R * n.axis;
    out.axis.col(n.coordinate) = w;
    out.origin.col(n.coordinate) = T.p;
    const double q = x[n.coordinate];
    if (n.type == JointType::prismatic) T.p += q * w;
    else if (q != 0) T.R = (T.R * rotation_about(n.axis, q)).eval();  // springs mostly stand at zero
    if (ball >= 0 && m.balls[at(ball)].first + 2 == n.coordinate) T.R = (T.R * charts->turns[at(ball)].after).eval();
  }
}

Vec6 frame_error(const Pose& a, const Pose& b) {
  Vec6 e;
  e << b.p - a.p, log_so3(b.R * a.R.transpose());
  return e;
}

}  // namespace stiffmap
