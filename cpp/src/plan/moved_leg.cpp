// SPDX-License-Identifier: MIT
#include "moved_leg.hpp"

#include <cstring>
#include <vector>

namespace stiffmap {
namespace {

constexpr std::int32_t nobody = -1;

template <class T>
bool same(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}

/// Legs that own operations and coordinates. Operations of a leg, with those of the blocks in it, are contiguous.
struct Owners {
  explicit Owners(const Program& p)
      : op(static_cast<std::size_t>(p.op_count), nobody),
        coordinate(static_cast<std::size_t>(p.coordinate_count), nobody) {
    const Op& legs = p.ops[p.legs_op];
    std::int32_t i = 0;
    for (std::int32_t k = 0; k < legs.count; ++k) {
      const ChainProgram& leg = p.chains[legs.first + k];
      for (; i < leg.first + leg.count; ++i) own(p.ops[i], static_cast<std::size_t>(i), k);
    }
  }
  void own(const Op& o, std::size_t i, std::int32_t leg) {
    op[i] = leg;
    const int width = o.kind == OpKind::spring ? 6 : 1;
    for (int q = 0; o.coordinate >= 0 && q < width; ++q) coordinate[static_cast<std::size_t>(o.coordinate + q)] = leg;
  }
  std::vector<std::int32_t> op, coordinate;
};

bool same_law(const Program& p, std::int32_t a, const Program& q, std::int32_t b) {
  if (a < 0 || b < 0) return a == b;
  const LawProgram &x = p.laws[a], &y = q.laws[b];
  if (x.stiffness != y.stiffness || x.cubic != y.cubic || x.friction != y.friction || x.count != y.count) return false;
  const auto bytes = static_cast<std::size_t>(3 * x.count) * sizeof(double);
  return bytes == 0 || std::memcmp(p.knots + 3 * x.first, q.knots + 3 * y.first, bytes) == 0;
}

bool same_stroke(const Program& p, std::int32_t a, const Program& q, std::int32_t b) {
  if (a < 0 || b < 0) return a == b;
  const StrokeProgram &x = p.strokes[a], &y = q.strokes[b];
  const auto bytes = static_cast<std::size_t>(stroke_row * x.count) * sizeof(double);
  return x.coordinate == y.coordinate && x.along == y.along && x.count == y.count && x.at == y.at &&
         x.length == y.length && x.rate == y.rate &&
         (bytes == 0 ||
          std::memcmp(p.stroke_rows + stroke_row * x.first, q.stroke_rows + stroke_row * y.first, bytes) == 0);
}

/// The one leg that was named, or nobody once two were.
struct One {
  std::int32_t leg = 0;
  bool any = false, fails = false;
  void name(std::int32_t owner) {
    fails = fails || owner == nobody || (any && owner != leg);
    any = true;
    leg = owner;
  }
};

}  // namespace

std::int32_t moved_leg(const Program& p, const Program& q) {
  if (p.legs_op != p.chains[p.root].first || p.chain_count != q.chain_count || p.error_count != q.error_count)
    return nobody;
  if (p.spring_count != q.spring_count) return nobody;
  for (std::int32_t i = 0; i < p.spring_count; ++i)
    if (!same(p.springs[i], q.springs[i])) return nobody;
  const Owners owners(p);
  const auto of = [&](std::int32_t coordinate) { return owners.coordinate[static_cast<std::size_t>(coordinate)]; };
  One one;
  for (std::int32_t i = 0; i < p.op_count; ++i)
    if (!same(p.ops[i], q.ops[i]) || !same_stroke(p, p.ops[i].stroke, q, q.ops[i].stroke))
      one.name(owners.op[static_cast<std::size_t>(i)]);
  for (std::int32_t i = 0; i < p.chain_count; ++i)
    if (!same(p.chains[i], q.chains[i]))
      one.name(i == p.root ? nobody : owners.op[static_cast<std::size_t>(p.chains[i].first)]);
  for (std::int32_t i = 0; i < p.coordinate_count; ++i)
    if (!same(p.coordinates[i], q.coordinates[i]) || !same_law(p, p.coordinates[i].law, q, q.coordinates[i].law))
      one.name(of(i));
  for (std::int32_t i = 0; i < p.error_count; ++i)
    if (!same(p.errors[i], q.errors[i])) one.name(of(p.errors[i].coordinate));
  for (std::int32_t i = 0; i < p.drive_count; ++i)
    if (p.drives[i].home != q.drives[i].home || p.drives[i].compliance_slope != q.drives[i].compliance_slope ||
        p.drives[i].sag != q.drives[i].sag)
      one.name(of(p.drives[i].coordinate));
  return one.fails ? nobody : one.leg;
}

}  // namespace stiffmap
