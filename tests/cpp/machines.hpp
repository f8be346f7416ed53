// SPDX-License-Identifier: MIT
// Machines of the tests, SI.
#pragma once

#include <string>
#include <vector>

#include "beam.hpp"
#include "stiffmap/solve/assemble.hpp"
#include "stiffmap/solve/solve.hpp"

namespace stiffmap::test {

inline Offset offset(const std::string& name, const Pose& T) { return {name, T, T}; }
inline Offset shift(const std::string& name, double x, double y, double z) {
  return offset(name, {Vec3(x, y, z), Mat3::Identity()});
}

inline Joint revolute(const std::string& name, const Vec3& axis, double home = 0) {
  Joint j;
  j.name = name;
  j.axis = axis;
  j.home = home;
  return j;
}

inline Joint actuator(const std::string& name, JointType type, const Vec3& axis, double home, double stiffness) {
  Joint j = revolute(name, axis, home);
  j.type = type;
  j.actuated = true;
  if (stiffness > 0) j.law = Law(stiffness);
  return j;
}

inline Spring virtual_spring(const std::string& name, const Mat6& stiffness) {
  Spring s;
  s.name = name;
  s.matrix = spring_from_stiffness(stiffness, name);
  return s;
}

/// A link about a metre long, round steel tube.
inline Mat6 link_stiffness(double length = 0.8) { return beam_compliance(length, {2e8, 3e4, 3e4, 2e4}).inverse(); }

inline Mat3 permutation(int first) {  // local x = base axis `first`, cyclic
  Mat3 R = Mat3::Zero();
  for (int i = 0; i < 3; ++i) R((first + i) % 3, i) = 1;
  return R;
}

struct Orthoglide {
  double L = 0.775, d = 0.25, r = 0.0775, k_actuator = 1e3 / 1.4e-4;

  Chain bar(double side) const {
    return {{shift("out", 0, 0, side * d / 2), revolute("proximal", Vec3::UnitY()), shift("length", L, 0, 0),
             virtual_spring("link", link_stiffness(L)), revolute("distal", Vec3::UnitY()),
             shift("back", 0, 0, -side * d / 2)}};
  }
  Chain leg(int axis) const {
    const Mat3 R = permutation(axis);
    return {{offset("frame", {Vec3::Zero(), R}),
             actuator("actuator", JointType::prismatic, Vec3::UnitX(), -r - L, k_actuator),
             virtual_spring("foot", link_stiffness(0.25)), revolute("proximal", Vec3::UnitZ()),
             Block{"bars", {{"low", bar(-1)}, {"high", bar(1)}}}, revolute("distal", Vec3::UnitZ()),
             shift("reach", r, 0, 0), offset("platform", {Vec3::Zero(), R.transpose()})}};
  }
  Mechanism build() const { return assemble({{Block{"legs", {{"x", leg(0)}, {"y", leg(1)}, {"z", leg(2)}}}}}, {}); }
  double rho(double x, double y, double z) const { return x - r - std::sqrt(L * L - y * y - z * z); }
};

/// An arm of two links and three rotary drives of which the axes are not parallel; one leg, no loop.
inline Mechanism arm() {
  const double q1 = 0.3, q2 = -0.7, q3 = 1.1;
  const Chain chain{{actuator("base", JointType::revolute, Vec3::UnitZ(), q1, 2e5), shift("column", 0.1, 0, 0.6),
                     actuator("shoulder", JointType::revolute, Vec3::UnitY(), q2, 1e5), shift("upper", 0.8, 0, 0),
                     virtual_spring("upper_link", link_stiffness()), Body{"upper_body", 12, Vec3(-0.4, 0, 0)},
                     actuator("elbow", JointType::revolute, Vec3::UnitY(), q3, 5e4), shift("fore", 0.6, 0.05, 0),
                     virtual_spring("fore_link", link_stiffness(0.6)), Body{"tool", 3, Vec3(0.02, 0.01, 0)},
                     Point{"hook", Vec3(-0.1, 0, 0.05)}}};
  Pose home;
  home = home * Pose{Vec3::Zero(), rotation_about(Vec3::UnitZ(), q1)} * Pose{Vec3(0.1, 0, 0.6), Mat3::Identity()};
  home = home * Pose{Vec3::Zero(), rotation_about(Vec3::UnitY(), q2)} * Pose{Vec3(0.8, 0, 0), Mat3::Identity()};
  home = home * Pose{Vec3::Zero(), rotation_about(Vec3::UnitY(), q3)} * Pose{Vec3(0.6, 0.05, 0), Mat3::Identity()};
  ExternalSpring counterbalance;
  counterbalance.name = "counterbalance";
  counterbalance.point = "arm.hook";
  counterbalance.anchor = Vec3(0, 0, 2);
  counterbalance.stiffness = 500;
  counterbalance.length = 0.5;
  return assemble({{Block{"legs", {{"arm", chain}}}}}, home, {counterbalance});
}

/// A rigid column of length L on a hinge with a rotational spring k, tip free: buckles at P = k / L.
inline Mechanism hinged_column(double k, double L) {
  const Chain chain{{actuator("hinge", JointType::revolute, Vec3::UnitY(), 0, k),
                     actuator("other", JointType::revolute, Vec3::UnitX(), 0, 10 * k), shift("column", 0, 0, L)}};
  return assemble({{Block{"legs", {{"column", chain}}}}}, {Vec3(0, 0, L), Mat3::Identity()});
}

/// A pose under one wrench at the tip.
inline PoseResult solve(const Mechanism& m, const Pose& commanded, const Vec6& wrench, LoadType type = LoadType::dead,
                        int load_steps = 0) {
  PoseInput in;
  in.commanded = commanded;
  in.load_points = {{m.tip, Vec3::Zero(), type}};
  in.wrenches = {wrench};
  in.read_points = {0};
  SolveOptions options;
  options.equilibrium.load_steps = load_steps;
  SolveWorkspace ws(m);
  PoseResult out;
  solve_pose(m, in, options, ws, out);
  return out;
}

}  // namespace stiffmap::test
