// SPDX-License-Identifier: MIT
#include "stiffmap/home_record.hpp"

namespace stiffmap {
namespace {

bool same(const Pose& a, const Pose& b) { return a.p == b.p && a.R == b.R; }

bool same(const Chain& a, const Chain& b);

bool same(const Offset& a, const Offset& b) { return same(a.nominal, b.nominal); }

bool same(const Joint& a, const Joint& b) {
  return a.type == b.type && a.axis == b.axis && a.actuated == b.actuated && a.home == b.home &&
         a.law.has_value() == b.law.has_value() && a.guide_errors.size() == b.guide_errors.size() && a.ball == b.ball &&
         a.lower == b.lower && a.upper == b.upper;
}

bool same(const Spring&, const Spring&) { return true; }  // springs rest where closure sees them

bool same(const Block& a, const Block& b) {
  if (a.name != b.name || a.branches.size() != b.branches.size()) return false;
  for (std::size_t i = 0; i < a.branches.size(); ++i)
    if (!same(a.branches[i].second, b.branches[i].second)) return false;
  return true;
}

/// Bodies and points are no part of the geometry.
bool counts(const decltype(Chain::elements)::value_type& e) {
  return !std::holds_alternative<Body>(e) && !std::holds_alternative<Point>(e);
}

bool same(const Chain& a, const Chain& b) {
  std::size_t i = 0, j = 0;
  for (;; ++i, ++j) {
    while (i < a.elements.size() && !counts(a.elements[i])) ++i;
    while (j < b.elements.size() && !counts(b.elements[j])) ++j;
    if (i == a.elements.size() || j == b.elements.size()) return i == a.elements.size() && j == b.elements.size();
    if (a.elements[i].index() != b.elements[j].index()) return false;
    const bool equal = std::visit(
        [&](const auto& e) {
          using Element = std::decay_t<decltype(e)>;
          if constexpr (std::is_same_v<Element, Body> || std::is_same_v<Element, Point>) return true;
          else return same(e, std::get<Element>(b.elements[j]));
        },
        a.elements[i]);
    if (!equal) return false;
  }
}

}  // namespace

bool HomeRecord::holds_for(const Chain& root, const Pose& home_pose, const Task& commanded, HomeSearch how) const {
  return task == commanded && search == how && same(home, home_pose) && same(declared, root);
}

}  // namespace stiffmap
