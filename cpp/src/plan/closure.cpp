// SPDX-License-Identifier: MIT
#include "closure.hpp"

#include <algorithm>
#include <map>

namespace stiffmap {
namespace {

constexpr int most_leg_unknowns = 48, most_unknowns = 192;  // as starts.hpp of the kernels

class ClosureCompiler {
 public:
  ClosureCompiler(const Mechanism& m, FastPlanData& out) : m_(m), out_(out) {}

  bool legs() {
    const Op block = out_.ops[static_cast<std::size_t>(out_.program.legs_op)];
    for (int k = 0; k < block.count; ++k)
      if (!close(block.first + k)) return false;
    return true;
  }

  bool whole() { return close(out_.program.root); }

 private:
  /// The loops inside a chain, and its end against the command.
  bool close(std::int32_t chain) {
    LegClosure leg{};
    leg.first_equation = i32(out_.equations.size());
    leg.first_unknown = i32(out_.unknowns.size());
    local_.clear();
    std::vector<ClosureTerm> way;
    follow(chain, way);
    add_equation(chain, -1, way);
    leg.equations = i32(out_.equations.size()) - leg.first_equation;
    leg.unknowns = i32(local_.size());
    if (leg.unknowns > most_leg_unknowns || leg.equations > most_leg_unknowns ||
        out_.unknowns.size() > static_cast<std::size_t>(most_unknowns))
      return false;
    for (int i = 0; i < leg.equations; ++i) {
      const ClosureEquation& e = out_.equations[static_cast<std::size_t>(leg.first_equation + i)];
      if (e.count > 2 * most_leg_unknowns) return false;
    }
    turn_round(leg);
    out_.legs.push_back(leg);
    return true;
  }

  /// Unknowns in the reverse order of the chains: those that all loops share come last, so that eliminating the
  /// others fills little; and the first entry of each row of the normal equations.
  void turn_round(const LegClosure& leg) {
    const auto first = out_.unknowns.begin() + leg.first_unknown;
    std::reverse(first, out_.unknowns.end());
    std::vector<std::int32_t> row(static_cast<std::size_t>(leg.unknowns));
    for (std::size_t i = 0; i < row.size(); ++i) row[i] = i32(i);
    for (int i = 0; i < leg.equations; ++i) {
      const ClosureEquation& e = out_.equations[static_cast<std::size_t>(leg.first_equation + i)];
      std::int32_t lowest = leg.unknowns;
      for (int t = 0; t < e.count; ++t) {
        std::int32_t& u = out_.terms[static_cast<std::size_t>(e.first + t)].unknown;
        u = leg.unknowns - 1 - u;
        lowest = std::min(lowest, u);
      }
      for (int t = 0; t < e.count; ++t) {
        std::int32_t& r = row[static_cast<std::size_t>(out_.terms[static_cast<std::size_t>(e.first + t)].unknown)];
        r = std::min(r, lowest);
      }
    }
    out_.envelope.insert(out_.envelope.end(), row.begin(), row.end());
  }

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

bool compile_closure(const Mechanism& m, FastPlanData& out) { return ClosureCompiler(m, out).legs(); }

bool compile_whole_closure(const Mechanism& m, FastPlanData& out) { return ClosureCompiler(m, out).whole(); }

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
