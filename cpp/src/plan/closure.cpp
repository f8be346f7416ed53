// SPDX-License-Identifier: MIT
#include "closure.hpp"

#include <map>

namespace stiffmap {
namespace {

constexpr int most_leg_unknowns = 24;

class ClosureCompiler {
 public:
  ClosureCompiler(const Mechanism& m, FastPlanData& out) : m_(m), out_(out) {}

  bool run() {
    const Op block = out_.ops[static_cast<std::size_t>(out_.program.legs_op)];
    for (int k = 0; k < block.count; ++k) {
      LegClosure leg{};
      leg.first_equation = i32(out_.equations.size());
      leg.first_unknown = i32(out_.unknowns.size());
      local_.clear();
      std::vector<ClosureTerm> way;
      const int chain = block.first + k;
      follow(chain, way);
      add_equation(chain, -1, way);
      leg.equations = i32(out_.equations.size()) - leg.first_equation;
      leg.unknowns = i32(local_.size());
      if (leg.unknowns > most_leg_unknowns || leg.equations > most_leg_unknowns ||
          out_.unknowns.size() > 8 * most_leg_unknowns)
        return false;
      out_.legs.push_back(leg);
    }
    return true;
  }

 private:
  /// Appends the joints of the primary way through a chain; loops met on it become equations.
  void follow(int chain, std::vector<ClosureTerm>& way) {
    const ChainProgram& c = out_.chains[static_cast<std::size_t>(chain)];
    for (int i = c.first; i < c.first + c.count; ++i) {
      const Op& op = out_.ops[static_cast<std::size_t>(i)];
      if (op.kind == OpKind::block) {
        std::vector<ClosureTerm> primary;
        follow(op.first, primary);
        for (int b = 1; b < op.count; ++b) {
          std::vector<ClosureTerm> loop;
          follow(op.first + b, loop);
          for (ClosureTerm t : primary) {
            t.sign = -t.sign;
            loop.push_back(t);
          }
          add_equation(op.first + b, op.first, loop);
        }
        way.insert(way.end(), primary.begin(), primary.end());
      } else if (op.kind <= OpKind::prismatic) {
        const Coordinate& k = m_.coordinates[static_cast<std::size_t>(op.coordinate)];
        if (k.role == Role::spring || (k.role == Role::passive && k.locked)) continue;
        way.push_back({local(op.coordinate), op.slot, op.kind == OpKind::prismatic, 1.0});
      }
    }
  }

  std::int32_t local(std::int32_t coordinate) {
    const auto [it, added] = local_.try_emplace(coordinate, i32(local_.size()));
    if (added) out_.unknowns.push_back(coordinate);
    return it->second;
  }

  void add_equation(int chain, int primary, const std::vector<ClosureTerm>& terms) {
    out_.equations.push_back({chain, primary, i32(out_.terms.size()), i32(terms.size())});
    out_.terms.insert(out_.terms.end(), terms.begin(), terms.end());
  }

  const Mechanism& m_;
  FastPlanData& out_;
  std::map<std::int32_t, std::int32_t> local_;
};

}  // namespace

bool compile_closure(const Mechanism& m, FastPlanData& out) { return ClosureCompiler(m, out).run(); }

bool only_legs_have_joints(const Mechanism& m, const FastPlanData& d) {
  const ChainProgram& root = d.chains[0];
  for (int i = root.first; i < root.first + root.count; ++i) {
    const OpKind kind = d.ops[static_cast<std::size_t>(i)].kind;
    if (kind == OpKind::block && i != d.program.legs_op) return false;
    if (kind > OpKind::prismatic) continue;
    const std::int32_t j = d.ops[static_cast<std::size_t>(i)].coordinate;
    if (m.coordinates[static_cast<std::size_t>(j)].role != Role::spring) return false;
  }
  return true;
}

}  // namespace stiffmap
