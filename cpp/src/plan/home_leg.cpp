// SPDX-License-Identifier: MIT
#include "home_leg.hpp"

namespace stiffmap {
namespace {

Pose frame_of(const Constant& c) { return {Vec3(c.p[0], c.p[1], c.p[2]), Mat3(Eigen::Map<const Mat3>(c.R))}; }

void move_at_home(const Op& op, double q, Pose& way) {
  const Vec3 axis(op.direction[0], op.direction[1], op.direction[2]);
  if (op.kind == OpKind::prismatic) way.p += q * (way.R * axis);
  else way.R = way.R * Eigen::AngleAxisd(q, axis).toRotationMatrix();
}

std::optional<HomeLeg> chain_at_home(const Mechanism& m, const FastPlanData& d, const ChainProgram& chain, Pose way) {
  HomeLeg out;
  for (int i = chain.first; i < chain.first + chain.count; ++i) {
    const Op& op = d.ops[static_cast<std::size_t>(i)];
    way = way * frame_of(op.nominal);
    if (op.kind == OpKind::block) return std::nullopt;
    if (op.kind > OpKind::prismatic) continue;
    const Coordinate& c = m.coordinates[static_cast<std::size_t>(op.coordinate)];
    if (c.role == Role::spring) continue;
    if (c.role == Role::actuator || !c.locked)
      out.joints.push_back({op.coordinate, op.kind == OpKind::prismatic,
                            way.R * Vec3(op.direction[0], op.direction[1], op.direction[2]), way.p});
    move_at_home(op, m.home_coordinates[op.coordinate], way);
  }
  out.end = way * frame_of(chain.nominal);
  return out;
}

}  // namespace

std::optional<HomeLeg> leg_at_home(const Mechanism& m, const FastPlanData& d, int leg) {
  const ChainProgram& root = d.chains[static_cast<std::size_t>(d.program.root)];
  Pose start;
  for (int i = root.first; i <= d.program.legs_op; ++i)
    start = start * frame_of(d.ops[static_cast<std::size_t>(i)].nominal);
  const Op& legs = d.ops[static_cast<std::size_t>(d.program.legs_op)];
  return chain_at_home(m, d, d.chains[static_cast<std::size_t>(legs.first + leg)], start);
}

}  // namespace stiffmap
