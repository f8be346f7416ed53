// SPDX-License-Identifier: MIT
#include "stiffmap/kinematics/rigid_tree.hpp"

namespace stiffmap {

RigidTree::RigidTree(const Mechanism& m) {
  std::vector<bool> moves(at(m.size()), false), kept(m.nodes.size(), false);
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (c.cable >= 0) continue;
    if (c.role != Role::actuator && (c.role != Role::passive || c.locked)) continue;
    moves[at(j)] = true;
    moving_.push_back(j);
  }
  const auto chosen = [&](const std::vector<Index>& path, std::size_t from) {
    std::vector<Index> out;
    for (std::size_t i = from; i < path.size(); ++i)
      if (moves[at(path[i])]) out.push_back(path[i]);
    return out;
  };
  kept[0] = true;
  kept[at(m.tip)] = true;
  tip_ = chosen(m.path[at(m.tip)], 0);
  for (const Loop& l : m.loops) {
    kept[at(l.primary)] = kept[at(l.end)] = true;
    const auto &a = m.path[at(l.primary)], &b = m.path[at(l.end)];
    std::size_t shared = 0;
    while (shared < a.size() && shared < b.size() && a[shared] == b[shared]) ++shared;
    loops_.push_back({chosen(a, shared), chosen(b, shared)});
  }
  std::vector<Pose> since(m.nodes.size());  // the kept frame behind each frame, and the transform from it
  std::vector<Index> behind(m.nodes.size(), 0);
  for (std::size_t i = 1; i < m.nodes.size(); ++i) {
    const Node& n = m.nodes[i];
    const std::size_t parent = at(n.parent);
    behind[i] = kept[parent] ? n.parent : behind[parent];
    since[i] = (kept[parent] ? Pose{} : since[parent]) * n.nominal;
    const bool moving = n.coordinate >= 0 && moves[at(n.coordinate)];
    if (n.coordinate >= 0 && !moving && m.coordinates[at(n.coordinate)].role != Role::spring) {
      const double held = m.home_coordinates[n.coordinate];
      if (n.type == JointType::prismatic) since[i].p += held * (since[i].R * n.axis);
      else since[i].R = (since[i].R * rotation_about(n.axis, held)).eval();
    }
    kept[i] = kept[i] || moving;
    if (kept[i])
      steps_.push_back({static_cast<Index>(i), behind[i], moving ? n.coordinate : -1, n.type, since[i], n.axis});
  }
}

void RigidTree::forward(const VecX& x, Frames& out) const {
  out.pose[0] = Pose{};
  for (const Step& s : steps_) {
    Pose& T = out.pose[at(s.node)];
    T = out.pose[at(s.parent)] * s.before;
    if (s.coordinate < 0) continue;
    const Vec3 w = T.R * s.axis;
    out.axis.col(s.coordinate) = w;
    out.origin.col(s.coordinate) = T.p;
    if (s.type == JointType::prismatic) T.p += x[s.coordinate] * w;
    else T.R = (T.R * rotation_about(s.axis, x[s.coordinate])).eval();
  }
}

}  // namespace stiffmap
