// SPDX-License-Identifier: MIT
// How far each leg can stretch: a certain no for targets beyond.
#include "closure.hpp"

namespace stiffmap {
namespace {

class Stretch {
 public:
  Stretch(const Mechanism& m, const FastPlanData& d) : m_(m), d_(d) {}

  ReachProgram of(std::int32_t leg) {
    const ChainProgram& root = d_.chains[static_cast<std::size_t>(d_.program.root)];
    const auto op = [&](int i) -> const Op& { return d_.ops[static_cast<std::size_t>(i)]; };
    for (int i = root.first; i <= d_.program.legs_op; ++i) way_ = way_ * pose(op(i).nominal);
    chain(leg);
    for (int i = d_.program.legs_op + 1; i < root.first + root.count; ++i) way_ = way_ * pose(op(i).nominal);
    way_ = way_ * pose(root.nominal);
    out_.known = out_.known && turned_;
    const Vec3 last = way_.inverse().p;  // the last centre as the tip sees it
    for (int i = 0; i < 3; ++i) out_.last[i] = last[i];
    return out_;
  }

 private:
  const Mechanism& m_;
  const FastPlanData& d_;
  ReachProgram out_{.first = {}, .last = {}, .along = {}, .slides = 0, .known = 1, .length = 0};
  Pose way_;             ///< from the base, or from the last turning joint
  bool turned_ = false;  ///< there was one

  static Pose pose(const Constant& c) { return {Vec3(c.p[0], c.p[1], c.p[2]), Mat3(Eigen::Map<const Mat3>(c.R))}; }

  /// The first branch of a block is the way through it; whatever the others do can only shorten it.
  void chain(std::int32_t index) {
    const ChainProgram& c = d_.chains[static_cast<std::size_t>(index)];
    for (int i = c.first; i < c.first + c.count; ++i) {
      const Op& op = d_.ops[static_cast<std::size_t>(i)];
      way_ = way_ * pose(op.nominal);
      if (op.kind == OpKind::block) chain(op.first);
      else if (op.kind <= OpKind::prismatic) joint(op);
    }
    way_ = way_ * pose(c.nominal);
  }

  void joint(const Op& op) {
    const Coordinate& c = m_.coordinates[static_cast<std::size_t>(op.coordinate)];
    if (c.role == Role::spring) return;
    const Vec3 axis(op.direction[0], op.direction[1], op.direction[2]);
    const double home = m_.home_coordinates[op.coordinate];
    const bool held = c.role == Role::passive && c.locked;
    if (op.kind == OpKind::prismatic) {
      if (held) way_.p += home * (way_.R * axis);
      else if (turned_) out_.known = 0;
      else slide(way_.R * axis);
    } else if (held) {
      way_.R = way_.R * exp_so3(home * axis);
    } else {
      turn();
    }
  }

  void slide(Vec3 axis) {
    for (int k = 0; k < out_.slides; ++k) {
      const Vec3 before(out_.along[k][0], out_.along[k][1], out_.along[k][2]);
      axis -= before.dot(axis) * before;
    }
    if (axis.norm() < 1e-9) return;
    axis.normalize();
    for (int i = 0; i < 3; ++i) out_.along[out_.slides][i] = axis[i];
    ++out_.slides;
  }

  void turn() {
    if (!turned_)
      for (int i = 0; i < 3; ++i) out_.first[i] = way_.p[i];
    else out_.length += way_.p.norm();
    turned_ = true;
    way_ = Pose{};
  }
};

}  // namespace

void bound_reach(const Mechanism& m, FastPlanData& out) {
  const Op& block = out.ops[static_cast<std::size_t>(out.program.legs_op)];
  for (int k = 0; k < block.count; ++k) out.reach.push_back(Stretch(m, out).of(block.first + k));
}

}  // namespace stiffmap
