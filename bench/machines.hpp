// SPDX-License-Identifier: MIT
// The benchmark machines from the chain API, with the numbers of the shipped files tripteron.yaml and
// orthoglide-revised.yaml (SI).
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

#include "beam.hpp"
#include "stiffmap/solve/assemble.hpp"

namespace stiffmap::bench {

/// A machine and the box of poses where it works.
struct Case {
  Mechanism mechanism;
  Vec3 low, high;
};

inline Offset offset(const std::string& name, const Vec3& p, const Mat3& R = Mat3::Identity()) {
  return {name, {p, R}, {p, R}};
}

inline Joint joint(const std::string& name, JointType type, const Vec3& axis, double home = 0) {
  Joint j;
  j.name = name;
  j.type = type;
  j.axis = axis;
  j.home = home;
  return j;
}

inline Joint slider(const std::string& name, const Vec3& axis, double home, double stiffness) {
  Joint j = joint(name, JointType::prismatic, axis, home);
  j.actuated = true;
  if (stiffness > 0) j.law = Law(stiffness);
  return j;
}

inline Spring link(const std::string& name, const Mat6& compliance) {
  Spring s;
  s.name = name;
  s.matrix = spring_from_compliance(compliance, name);
  return s;
}

inline Mat3 columns(const Vec3& x, const Vec3& y, const Vec3& z) {
  Mat3 R;
  R << x, y, z;
  return R;
}

/// Three P-RRR legs, round aluminium links of 0.75 m.
inline Case tripteron() {
  const Vec3 X = Vec3::UnitX(), Y = Vec3::UnitY(), Z = Vec3::UnitZ();
  const double L = 0.75, d = 0.15, A = M_PI * d * d / 4, I = M_PI * std::pow(d, 4) / 64;
  const Mat6 C = test::beam_compliance(L, {7.0e10 * A, 7.0e10 * I, 7.0e10 * I, 2.55e10 * 2 * I});
  const auto leg = [&](const Vec3& at, const Mat3& R, double s, double q1, double q2, double q3) {
    return Chain{{offset("frame", at, R), slider("actuator", Z, s, 1e6), joint("proximal", JointType::revolute, Z, q1),
                  offset("upper", L * X), link("proximal_link", C), joint("elbow", JointType::revolute, Z, q2),
                  offset("lower", L * X), link("distal_link", C), joint("distal", JointType::revolute, Z, q3),
                  offset("platform", Vec3::Zero(), R.transpose())}};
  };
  const double a1 = -0.30366419933916244, a2 = 2.4619188346815495, a3 = -2.158254635342387;
  const double b1 = -0.29451548510813663, b2 = 2.1598272970111703, b3 = -1.8653118119030336;
  const Block legs{"legs",
                   {{"1", leg(Vec3::Zero(), columns(X, Y, Z), 0.5, a1, a2, a3)},
                    {"2", leg(0.9 * Y, columns(Z, -Y, X), 0.3, b1, b2, b3)},
                    {"3", leg(0.9 * Z, columns(X, -Z, Y), 0.4, a1, a2, a3)}}};
  return {assemble({{legs}}, {Vec3(0.3, 0.4, 0.5), Mat3::Identity()}), Vec3::Zero(), Vec3::Constant(0.9)};
}

/// Compliance of the Orthoglide's bar: diagonal of the paper's Table 1, couplings of a uniform beam.
inline Mat6 orthoglide_bar() {
  Vec6 diagonal;
  diagonal << 3.1e-8, 3.54e-4, 6.91e-5, 3.9e-3, 3.3e-4, 1.74e-3;
  Mat6 C = diagonal.asDiagonal();
  C(1, 5) = C(5, 1) = 0.5 * std::sqrt(3.0 * C(1, 1) * C(5, 5));
  C(2, 4) = C(4, 2) = -0.5 * std::sqrt(3.0 * C(2, 2) * C(4, 4));
  return C;
}

/// The foot: a cantilever along local -y.
inline Mat6 orthoglide_foot() {
  const Mat3 R = columns(-Vec3::UnitY(), Vec3::UnitX(), Vec3::UnitZ());
  Mat6 Q = Mat6::Zero();
  Q.topLeftCorner<3, 3>() = Q.bottomRightCorner<3, 3>() = R;
  return Q * test::beam_compliance(0.25, {2e8, 2e3, 2e4, 1.5e4}) * Q.transpose();
}

/// Six bars in three parallelograms, feet, compliant drives.
inline Case orthoglide() {
  const Vec3 X = Vec3::UnitX(), Y = Vec3::UnitY(), Z = Vec3::UnitZ();
  const double L = 0.775, spread = 0.125, r = 0.0775;
  const auto bar = [&](double side) {
    return Chain{{offset("spread", side * spread * Z), joint("pin_proximal", JointType::revolute, Y),
                  offset("length", L * X), link("bar", orthoglide_bar()), joint("pin_distal", JointType::revolute, Y),
                  offset("close", -side * spread * Z)}};
  };
  const auto leg = [&](const Mat3& R) {
    return Chain{{offset("frame", Vec3::Zero(), R), slider("actuator", X, -r - L, 1 / 1.4e-7),
                  link("foot", orthoglide_foot()), joint("proximal", JointType::revolute, Z),
                  Block{"parallelogram", {{"low", bar(-1)}, {"high", bar(1)}}}, joint("distal", JointType::revolute, Z),
                  offset("flange", r * X), offset("platform", Vec3::Zero(), R.transpose())}};
  };
  const Block legs{"legs", {{"x", leg(columns(X, Y, Z))}, {"y", leg(columns(Y, Z, X))}, {"z", leg(columns(Z, X, Y))}}};
  return {assemble({{legs}}, {}), Vec3::Constant(-0.2), Vec3::Constant(0.3)};
}

/// One leg: a rigid gantry x, y, z, then a metre of beam cut into n springs.
inline Case serial(int n) {
  Chain leg{{slider("x", Vec3::UnitX(), 0, 0), slider("y", Vec3::UnitY(), 0, 0), slider("z", Vec3::UnitZ(), 0, 0)}};
  for (int i = 0; i < n; ++i) {
    const std::string number = std::to_string(i);
    leg.elements.emplace_back(offset("length" + number, Vec3(1.0 / n, 0, 0)));
    leg.elements.emplace_back(link("link" + number, test::beam_compliance(1.0 / n, {2e8, 3e5, 3e5, 2e5})));
  }
  const Vec3 home(1, 0, 0);
  return {assemble({{Block{"legs", {{"arm", leg}}}}}, {home, Mat3::Identity()}), home - Vec3::Constant(0.1),
          home + Vec3::Constant(0.1)};
}

inline Case machine(const std::string& name) {
  if (name == "tripteron") return tripteron();
  if (name == "orthoglide") return orthoglide();
  throw std::invalid_argument("--machine: expected tripteron or orthoglide, got " + name);
}

}  // namespace stiffmap::bench
