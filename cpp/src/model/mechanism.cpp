// SPDX-License-Identifier: MIT
#include "stiffmap/model/mechanism.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "stiffmap/common/check.hpp"

namespace stiffmap {
namespace {

template <class... Ts>
struct Overload : Ts... {
  using Ts::operator()...;
};
template <class... Ts>
Overload(Ts...) -> Overload<Ts...>;

std::string join(const std::string& prefix, const std::string& name) {
  return prefix.empty() ? name : prefix + "." + name;
}

bool has_legs(const Chain& chain) {
  return std::any_of(chain.elements.begin(), chain.elements.end(), [](const auto& e) {
    const Block* block = std::get_if<Block>(&e);
    return block && block->name == "legs";
  });
}

}  // namespace

Mechanism::Mechanism(const Chain& root, const Pose& home_pose, const std::vector<ExternalSpring>& springs)
    : home(home_pose), description(root) {
  nodes.push_back({});  // the base
  path.push_back({});
  beyond_legs.push_back(false);
  tip = add_chain(root, 0, "", true);
  points.insert(points.begin(), NodePoint{"tcp", tip, Vec3::Zero()});
  finish(springs);
}

Index Mechanism::add_node(Index parent, const Pose& nominal, const Pose& actual) {
  nodes.push_back({parent, nominal, actual, -1, JointType::revolute, Vec3::UnitZ()});
  path.push_back(path[static_cast<std::size_t>(parent)]);
  beyond_legs.push_back(beyond_legs[static_cast<std::size_t>(parent)]);
  return static_cast<Index>(nodes.size()) - 1;
}

Index Mechanism::add_coordinate(Index parent, const std::string& name, Role role, JointType type, const Vec3& axis,
                                double home_value) {
  const Index node = add_node(parent, {}, {});
  Node& n = nodes[static_cast<std::size_t>(node)];
  n.coordinate = size();
  n.type = type;
  n.axis = axis;
  path[static_cast<std::size_t>(node)].push_back(n.coordinate);
  Coordinate c;
  c.name = name;
  c.role = role;
  c.node = node;
  c.type = type;
  c.home = home_value;
  coordinates.push_back(c);
  return node;
}

Index Mechanism::add_joint(const Joint& joint, Index node, const std::string& prefix) {
  const std::string name = join(prefix, joint.name);
  require(std::abs(joint.axis.norm() - 1) < 1e-9, name + ".axis", "a unit vector", joint.axis.norm());
  node =
      add_coordinate(node, name, joint.actuated ? Role::actuator : Role::passive, joint.type, joint.axis, joint.home);
  Coordinate& c = coordinates.back();
  c.lower = joint.lower;
  c.upper = joint.upper;
  if (joint.law) {
    c.law = static_cast<Index>(laws.size());
    laws.push_back(*joint.law);
  }
  require(joint.friction == 0 || (!joint.actuated && !joint.law), name + ".friction", "a free passive joint",
          "another");
  c.friction = joint.friction;
  c.about_command = joint.about_command;
  c.rest = joint.rest;
  if (joint.ball != BallChart::none) charts.emplace_back(size() - 1, joint.ball);
  if (!joint.actuated) return node;
  c.actuator = static_cast<Index>(drives.size());
  c.locked = !joint.law;
  Drive drive{name, size() - 1, joint.numbers, {}};
  for (const CommandError& e : joint.command_errors) {
    for (std::size_t i = 1; i < e.knots.size(); ++i)
      require(e.knots[i].first > e.knots[i - 1].first, name + ".command_errors.knots", "rising coordinates",
              e.knots[i].first);
    drive.errors.push_back({drive.coordinate, drive.coordinate, e});
  }
  drives.push_back(drive);
  return add_guide_errors(joint, node, name);
}

/// Each deviation is a coordinate of its own that nothing moves but its error; no closure knows it.
Index Mechanism::add_guide_errors(const Joint& joint, Index node, const std::string& name) {
  for (std::size_t i = 0; i < joint.guide_errors.size(); ++i) {
    const GuideError& e = joint.guide_errors[i];
    require(std::abs(e.axis.norm() - 1) < 1e-9, name + ".guide_errors", "a unit vector", e.axis.norm());
    node = add_coordinate(node, name + ".deviation" + std::to_string(i + 1), Role::spring, JointType::prismatic, e.axis,
                          0.0);
    coordinates.back().locked = true;
    drives.back().errors.push_back({size() - 1, drives.back().coordinate, e.error});
  }
  return node;
}

Index Mechanism::add_spring(const Spring& spring, Index node, const std::string& prefix) {
  const std::string name = join(prefix, spring.name);
  SpringGroup group{name, size(), spring.matrix, spring.rest, spring.stroke};
  static const char* axes[] = {"tx", "ty", "tz", "rx", "ry", "rz"};
  for (int i = 0; i < 6; ++i) {
    node = add_coordinate(node, name + "." + axes[i], Role::spring, i < 3 ? JointType::prismatic : JointType::revolute,
                          Vec3::Unit(i % 3), 0.0);
    if (spring.matrix.rigid[i] && !spring.matrix.rotated) coordinates.back().rest = spring.rest[i];
  }
  for (const auto& [direction, law] : spring.laws) {
    Mat6& K = group.matrix.stiffness;
    require(!group.matrix.rotated, name, "a law on a spring without hidden rank defect", direction);
    for (int i = 0; i < 6; ++i)
      require(i == direction || K(i, direction) == 0, name + ".laws", "an uncoupled direction", axes[direction]);
    K(direction, direction) = 0;
    group.matrix.rigid[direction] = false;
    Coordinate& c = coordinates[static_cast<std::size_t>(group.first + direction)];
    c.law = static_cast<Index>(laws.size());
    c.rest = spring.rest[direction];  // the law's own deflection counts from there
    laws.push_back(law);
  }
  if (spring.stroke) {
    require(spring.laws.empty(), name + ".stroke", "a spring without laws", spring.laws.size());
    check_stroke(*spring.stroke, spring.matrix, name);
  }
  groups.push_back(group);
  return node;
}

Index Mechanism::add_block(const Block& block, Index start, const std::string& prefix, bool outermost) {
  const bool is_legs = outermost && block.name == "legs" && legs.empty();
  if (is_legs) outside.clear();
  const std::string name = join(prefix, block.name);
  require(is_legs || !block.branches.empty(), name, "one branch or more", 0);
  Index primary = -1;
  for (const auto& [branch, chain] : block.branches) {
    // A leg's elements are named after the leg alone: "x.foot", not "legs.x.foot".
    const Index end = add_chain(chain, start, join(is_legs ? "" : prefix, branch), false);
    if (is_legs) legs.push_back(branch);
    if (primary < 0) primary = end;
    else loops.push_back({name, branch, primary, end, is_legs, join(is_legs ? "" : prefix, branch)});
  }
  if (is_legs) {
    primary = add_node(primary < 0 ? start : primary, {}, {});  // the platform: what follows belongs to no leg
    beyond_legs[static_cast<std::size_t>(primary)] = true;
    outside = "platform";
  }
  return primary;
}

Index Mechanism::add_chain(const Chain& chain, Index node, const std::string& prefix, bool outermost) {
  if (outermost && has_legs(chain)) outside = "base";
  for (const auto& element : chain.elements) {
    std::visit(Overload{
                   [&](const Offset& e) { node = add_node(node, e.nominal, e.actual); },
                   [&](const Joint& e) { node = add_joint(e, node, prefix); },
                   [&](const Spring& e) { node = add_spring(e, node, prefix); },
                   [&](const Body& e) { bodies.push_back({join(prefix, e.name), node, e.mass, e.com}); },
                   [&](const Point& e) { points.push_back({join(outside, join(prefix, e.name)), node, e.offset}); },
                   [&](const Block& e) { node = add_block(e, node, prefix, outermost); },
               },
               element);
  }
  return node;
}

Index Mechanism::point(const std::string& name) const {
  std::string known;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].name == name) return static_cast<Index>(i);
    known += (i ? ", " : "") + points[i].name;
  }
  require(false, "point", "one of " + known, name);
  return -1;
}

/// In the sequence of the element `scope`, else in the nearest around it; -1: there is none.
Index Mechanism::joint_near(const std::string& joint, std::string scope) const {
  while (!scope.empty()) {
    const std::size_t dot = scope.rfind('.');
    scope = dot == std::string::npos ? "" : scope.substr(0, dot);
    for (Index j = 0; j < size(); ++j) {
      const Coordinate& c = coordinates[static_cast<std::size_t>(j)];
      if (c.role != Role::spring && c.name == join(scope, joint)) return j;
    }
  }
  return -1;
}

/// Joints that springs vary with, and that errors of drives are of.
void Mechanism::find_joints() {
  for (SpringGroup& g : groups) {
    if (!g.stroke) continue;
    const bool whole = g.stroke->joint.front() == '.';  // a full name outside the legs
    g.varies_with = joint_near(g.stroke->joint.substr(whole ? 1 : 0), whole ? "outside" : g.name);
    require(g.varies_with >= 0, g.name + ".stroke", "a joint of one axis", g.stroke->joint);
  }
  for (Drive& d : drives)
    for (DriveError& e : d.errors) {
      if (!e.error.of.empty()) e.of = joint_near(e.error.of, d.name);
      require(e.of >= 0, d.name + ".coupled", "a joint of one axis", e.error.of);
    }
}

/// Its free length is a coordinate behind which nothing stands, held where it is commanded.
void Mechanism::add_cable(const ExternalSpring& spring) {
  const Winch& w = *spring.winch;
  require(std::abs(w.axis.norm() - 1) < 1e-9, spring.name + ".axis", "a unit vector", w.axis.norm());
  require(w.elasticity > 0 || spring.stiffness > 0, spring.name, "an elasticity or a stiffness", 0);
  add_coordinate(0, spring.name, Role::actuator, JointType::prismatic, Vec3::UnitZ(), spring.length);
  Coordinate& c = coordinates.back();
  c.lower = w.lower;
  c.upper = w.upper;
  c.locked = true;
  c.cable = static_cast<Index>(external_springs.size()) - 1;
  c.actuator = static_cast<Index>(drives.size());
  Drive drive{spring.name, size() - 1, w.numbers, {}};
  for (const CommandError& e : w.errors) drive.errors.push_back({drive.coordinate, drive.coordinate, e});
  drives.push_back(drive);
  external_springs.back().coordinate = size() - 1;
  cables.push_back(c.cable);
}

bool Mechanism::floats() const {
  if (cables.empty() || !loops.empty() || !legs.empty() || !groups.empty()) return false;
  const auto& free = path[static_cast<std::size_t>(tip)];
  return free.size() + cables.size() == coordinates.size() && std::all_of(free.begin(), free.end(), [&](Index j) {
           const Coordinate& c = coordinates[static_cast<std::size_t>(j)];
           return c.role == Role::passive && c.law < 0 && c.friction == 0;
         });
}

void Mechanism::finish(const std::vector<ExternalSpring>& springs) {
  for (const ExternalSpring& s : springs) {
    const NodePoint& p = points[static_cast<std::size_t>(point(s.point))];
    external_springs.push_back({s.name, p.node, p.offset, s.anchor, s.stiffness, s.length, s.tension_only, s.winch});
    if (s.winch) add_cable(s);
  }
  floating = floats();
  std::set<std::string> names;
  for (const Coordinate& c : coordinates)
    require(names.insert(c.name).second, "element names", "different names within a sequence", c.name);
  home_coordinates = VecX::Zero(size());
  for (Index j = 0; j < size(); ++j) home_coordinates[j] = coordinates[static_cast<std::size_t>(j)].home;
  for (const Drive& d : drives)
    require(d.numbers.sag == 0 ||
                (loops.empty() && coordinates[static_cast<std::size_t>(d.coordinate)].type == JointType::revolute),
            d.name + ".sag", "a joint that turns, of a machine of one chain", "another");
  set_rest();
  find_joints();
  find_balls();
  set_scales();
}

void Mechanism::set_rest() {
  rest = home_coordinates;
  for (Index j = 0; j < size(); ++j) rest[j] = coordinates[static_cast<std::size_t>(j)].rest.value_or(rest[j]);
}

/// Locked where the third axis, turned about the second by its coordinate, lies along the first.
void Mechanism::find_balls() {
  for (const auto& [first, chart] : charts) {
    const auto axis = [this, first = first](Index k) -> const Vec3& {  // older clang captures no binding
      return nodes[static_cast<std::size_t>(coordinates[static_cast<std::size_t>(first + k)].node)].axis;
    };
    const Vec3 &a = axis(0), &b = axis(1), &c = axis(2);
    if (std::abs(a.dot(b)) > 1e-9 || std::abs(b.dot(c)) > 1e-9) continue;  // axes of its own kind: never quite locked
    const double from_first = std::atan2(b.dot(a.cross(c)), a.dot(c));
    for (Index k = 0; k < 3; ++k)
      coordinates[static_cast<std::size_t>(first + k)].ball = static_cast<Index>(balls.size());
    balls.push_back({first, std::numbers::pi / 2 - from_first, chart == BallChart::free});
  }
}

void Mechanism::set_scales() {
  // Length: the farthest frame or anchor of a cable from the centre of all, at home.
  std::vector<Pose> at(nodes.size());
  std::vector<Vec3> places;
  Vec3 mean = Vec3::Zero();
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    const Node& n = nodes[i];
    at[i] = at[static_cast<std::size_t>(n.parent)] * n.nominal;
    if (n.coordinate >= 0 && coordinates[static_cast<std::size_t>(n.coordinate)].cable >= 0) continue;
    if (n.coordinate >= 0) {
      const double x = coordinates[static_cast<std::size_t>(n.coordinate)].home;
      if (n.type == JointType::revolute) at[i].R = (at[i].R * rotation_about(n.axis, x)).eval();
      else at[i].p += at[i].R * n.axis * x;
    }
    places.push_back(at[i].p);
  }
  for (const Index i : cables) places.push_back(external_springs[static_cast<std::size_t>(i)].anchor);
  for (const Vec3& p : places) mean += p;
  mean /= static_cast<double>(std::max<std::size_t>(1, places.size()));
  double radius = 0;
  for (const Vec3& p : places) radius = std::max(radius, (p - mean).norm());
  // A single link has all its frames in one place: then the reach from the base counts, else that of what holds it.
  if (radius > 1e-9 * mean.norm()) length = radius;
  else if (mean.norm() > 0) length = mean.norm();
  else if (const double far = farthest_anchor(); far > 0) length = far;

  // Stiffness: geometric mean over all elastic directions, angles as arcs at that length.
  double sum = 0;
  int count = 0;
  const auto add = [&](double k) {
    if (k > 0) {
      sum += std::log(k);
      ++count;
    }
  };
  for (const SpringGroup& g : groups)
    for (int i = 0; i < 6; ++i) {
      const double u = i < 3 || g.matrix.rotated ? 1.0 : length;
      add(g.matrix.stiffness(i, i) / (u * u));
    }
  for (Index j = 0; j < size(); ++j) {
    const Coordinate& c = coordinates[static_cast<std::size_t>(j)];
    if (c.law >= 0) add(laws[static_cast<std::size_t>(c.law)].stiffness() / (unit(j) * unit(j)));
  }
  for (const Index i : cables) {
    const NodeSpring& s = external_springs[static_cast<std::size_t>(i)];
    add(s.winch->elasticity > 0 ? s.winch->elasticity / length : s.stiffness);
  }
  if (count == 0)  // nothing but springs outside the legs yields
    for (const NodeSpring& s : external_springs) add(s.stiffness);
  if (count) stiffness = std::exp(sum / count);
}

double Mechanism::farthest_anchor() const {
  double far = 0;
  for (const NodeSpring& s : external_springs) far = std::max(far, s.anchor.norm());
  return far;
}

}  // namespace stiffmap
