// SPDX-License-Identifier: MIT
#include "spins.hpp"

#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr double round_off = 1e-9;
constexpr double same_turn = 0.05;  ///< rad by a radian: no axis is along the line but for errors of the build

/// The joint that turns back as the spin turns; -1: there is no single one.
Index partner(const Mechanism& m, Index held, const VecX& motion) {
  Index found = -1;
  for (Index i = 0; i < m.size(); ++i) {
    const double rate = std::abs(motion[i]) * m.unit(i) / m.length;
    if (i == held || rate < same_turn) continue;
    const Coordinate& c = m.coordinates[static_cast<std::size_t>(i)];
    const bool turns = c.type == JointType::revolute && c.role == Role::passive && c.law < 0 && !c.locked;
    if (found >= 0 || !turns || std::abs(std::abs(motion[i]) - 1) > same_turn) return -1;
    found = i;
  }
  return found;
}

std::int32_t operation(const FastPlanData& d, Index coordinate) {
  const auto here = [coordinate](const Op& op) { return op.kind <= OpKind::prismatic && op.coordinate == coordinate; };
  const auto at = std::find_if(d.ops.begin(), d.ops.end(), here);
  return at == d.ops.end() ? -1 : i32(at - d.ops.begin());
}

/// The only chain that has both operations, with no block between them; -1: none.
std::int32_t chain_of(const FastPlanData& d, std::int32_t first, std::int32_t last) {
  for (std::size_t c = 0; c < d.chains.size(); ++c) {
    const ChainProgram& chain = d.chains[c];
    if (first < chain.first || last >= chain.first + chain.count) continue;
    if (chain.group >= 0) return -1;
    for (std::int32_t i = first; i <= last; ++i)
      if (d.ops[static_cast<std::size_t>(i)].kind == OpKind::block) return -1;
    return i32(c);
  }
  return -1;
}

Vec3 direction(const Op& op) { return {op.direction[0], op.direction[1], op.direction[2]}; }

/// Whether a spring is the same, turned about an axis through its frame's origin.
bool turns_alike(const Op& op, const Vec3& axis) {
  const Mat6 K = Eigen::Map<const Mat6>(op.K);
  Mat6 T = Mat6::Zero();
  T.topLeftCorner<3, 3>() = T.bottomRightCorner<3, 3>() = Eigen::AngleAxisd(1.0, axis).toRotationMatrix();
  const Vec6 size = K.diagonal().cwiseAbs().cwiseSqrt();
  const Mat6 change = T * K * T.transpose() - K;
  double largest = 0;
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k) largest = std::max(largest, std::abs(change(i, k)) / (size[i] * size[k]));
  return op.stroke < 0 && Eigen::Map<const Vec6>(op.rest).isZero(0) && largest < round_off;
}

/// Whether everything between the two axes is round about them: a spin that no load on the tip and no weight turns.
bool round(const Mechanism& m, const FastPlanData& d, std::int32_t first, std::int32_t last) {
  const auto op = [&d](std::int32_t i) -> const Op& { return d.ops[static_cast<std::size_t>(i)]; };
  Vec3 axis = direction(op(first)), at = Vec3::Zero();  // of the spin, in the frame behind the operation before
  const auto on_axis = [&](const Vec3& p) { return (p - at).cross(axis).norm() < round_off * m.length; };
  const auto along = [&](const Op& o) { return direction(o).cross(axis).norm() < round_off; };
  for (std::int32_t i = first + 1; i <= last; ++i) {
    const Constant& c = op(i).actual;
    const Mat3 R = Eigen::Map<const Mat3>(c.R);
    if (!on_axis(Vec3(c.p[0], c.p[1], c.p[2]))) return false;
    axis = R.transpose() * axis;
    const Op& o = op(i);
    const bool fits = o.kind == OpKind::spring  ? turns_alike(o, axis)
                      : o.kind == OpKind::load  ? on_axis(Vec3(o.com[0], o.com[1], o.com[2]))
                      : o.kind == OpKind::block ? false
                                                : along(o);
    for (int k = 0; o.kind == OpKind::spring && k < 6; ++k)
      if (d.coordinates[static_cast<std::size_t>(o.coordinate + k)].law >= 0) return false;
    if (!fits) return false;
  }
  return true;
}

}  // namespace

bool let_spins_hang(const Mechanism& m, const Spins& spins, FastPlanData& d) {
  if (spins.held().size() > static_cast<std::size_t>(most_spins)) return false;
  std::vector<SpinProgram> found;
  for (std::size_t k = 0; k < spins.held().size(); ++k) {
    const Index held = spins.held()[k], other = partner(m, held, spins.motion().col(static_cast<Index>(k)));
    const std::int32_t here = operation(d, held), there = other < 0 ? -1 : operation(d, other);
    if (here < 0 || there < 0) return false;
    const auto [first, last] = std::minmax(here, there);
    const std::int32_t chain = chain_of(d, first, last);
    const auto in_it = [chain](const SpinProgram& s) { return s.chain == chain; };
    if (chain < 0 || std::any_of(found.begin(), found.end(), in_it)) return false;
    const bool heavy = spins.moves_a_body()[k];
    if (!heavy && !round(m, d, first, last)) return false;
    found.push_back({chain, first, last, i32(held), heavy});
  }
  d.spins = found;
  d.hanging_ops = d.ops;
  for (const SpinProgram& s : found)
    if (s.heavy) d.hanging_ops[static_cast<std::size_t>(operation(d, s.held))].eliminated = 1;
  return true;
}

}  // namespace stiffmap
