// SPDX-License-Identifier: MIT
#include "places.hpp"

#include <algorithm>
#include <iterator>

namespace stiffmap {
namespace {

/// The steps from the base to each place.
class Ways {
 public:
  explicit Ways(FastPlanData& d) : d_(d), entered_by_(d.chains.size(), -1), inside_(d.ops.size(), -1) {
    for (std::size_t c = 0; c < d.chains.size(); ++c)
      for (std::int32_t i = d.chains[c].first; i < d.chains[c].first + d.chains[c].count; ++i) {
        const Op& op = d.ops[static_cast<std::size_t>(i)];
        inside_[static_cast<std::size_t>(i)] = i32(c);
        for (std::int32_t k = 0; op.kind == OpKind::block && k < op.count; ++k)
          entered_by_[static_cast<std::size_t>(op.first + k)] = i;
      }
  }

  void to(const PlaceInChain& at) {
    start(i32(at.chain));
    along(i32(at.chain), i32(at.behind));
  }

 private:
  FastPlanData& d_;
  std::vector<std::int32_t> entered_by_;  ///< per chain: the block that it is a branch of
  std::vector<std::int32_t> inside_;      ///< per operation: its chain

  const ChainProgram& chain(std::int32_t c) const { return d_.chains[static_cast<std::size_t>(c)]; }

  /// To where a chain starts.
  void start(std::int32_t c) {
    const std::int32_t block = entered_by_[static_cast<std::size_t>(c)];
    if (block < 0) return;
    const std::int32_t around = inside_[static_cast<std::size_t>(block)];
    start(around);
    along(around, block - chain(around).first);
    d_.place_steps.push_back(block);
  }

  /// Through the first operations of a chain; through blocks by their first branch.
  void along(std::int32_t c, std::int32_t count) {
    for (std::int32_t i = chain(c).first; i < chain(c).first + count; ++i) {
      const Op& op = d_.ops[static_cast<std::size_t>(i)];
      d_.place_steps.push_back(i);
      if (op.kind != OpKind::block) continue;
      along(op.first, chain(op.first).count);
      d_.place_steps.push_back(~op.first);
    }
  }
};

}  // namespace

FromTip from_tip(const Mechanism& m, Index node) {
  FromTip way;
  for (Index at = m.tip; at != node; at = m.nodes[static_cast<std::size_t>(at)].parent) {
    const Node* n = at < 0 ? nullptr : &m.nodes[static_cast<std::size_t>(at)];
    if (!n || n->coordinate >= 0) return {false, {}, {}};
    way.nominal = n->nominal * way.nominal;
    way.actual = n->actual * way.actual;
  }
  return {true, way.nominal.inverse(), way.actual.inverse()};
}

void compile_places(const Mechanism& m, const CompiledChains& chains, FastPlanData& d) {
  Ways ways(d);
  for (std::size_t i = 0; i < m.points.size(); ++i) {
    const Pose offset{m.points[i].offset, Mat3::Identity()};
    const FromTip tip = from_tip(m, m.points[i].node);
    PlaceProgram p{tip.rigid, i32(d.place_steps.size()), 0, 0, {}, {}};
    if (!tip.rigid) ways.to(chains.places[i - 1]);
    p.count = i32(d.place_steps.size()) - p.first;
    p.nominal = constant(tip.rigid ? tip.nominal * offset : chains.places[i - 1].nominal);
    p.actual = constant(tip.rigid ? tip.actual * offset : chains.places[i - 1].actual);
    p.turned = !std::equal(std::begin(p.actual.R), std::end(p.actual.R), std::begin(p.nominal.R));
    d.places.push_back(p);
  }
}

}  // namespace stiffmap
