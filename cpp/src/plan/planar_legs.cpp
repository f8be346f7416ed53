// SPDX-License-Identifier: MIT
// Recognises legs of three parallel revolutes and a slide along them, and takes their numbers at home.
#include <cmath>
#include <complex>
#include <optional>

#include "closure.hpp"

namespace stiffmap {
namespace {

using Complex = std::complex<double>;

constexpr double parallel = 1e-12;
constexpr double shortest = 1e-3;  // arms relative to the mechanism's length, sine of the bend at home

Pose pose(const Constant& c) { return {Vec3(c.p[0], c.p[1], c.p[2]), Mat3(Eigen::Map<const Mat3>(c.R))}; }

struct HomeJoint {
  std::int32_t coordinate;
  bool prismatic;
  Vec3 axis, point;
};

/// What moves in the closure, and the frame at a chain's end, at home in base axes.
struct HomeLeg {
  std::vector<HomeJoint> joints;
  Pose end;
};

void move(const Op& op, double q, Pose& way) {
  const Vec3 axis(op.direction[0], op.direction[1], op.direction[2]);
  if (op.kind == OpKind::prismatic) way.p += q * (way.R * axis);
  else way.R = way.R * Eigen::AngleAxisd(q, axis).toRotationMatrix();
}

std::optional<HomeLeg> at_home(const Mechanism& m, const FastPlanData& d, const ChainProgram& chain, Pose way) {
  HomeLeg out;
  for (int i = chain.first; i < chain.first + chain.count; ++i) {
    const Op& op = d.ops[static_cast<std::size_t>(i)];
    way = way * pose(op.nominal);
    if (op.kind == OpKind::block) return std::nullopt;
    if (op.kind > OpKind::prismatic) continue;
    const Coordinate& c = m.coordinates[static_cast<std::size_t>(op.coordinate)];
    if (c.role == Role::spring) continue;
    if (c.role == Role::actuator || !c.locked)
      out.joints.push_back({op.coordinate, op.kind == OpKind::prismatic,
                            way.R * Vec3(op.direction[0], op.direction[1], op.direction[2]), way.p});
    move(op, m.home_coordinates[op.coordinate], way);
  }
  out.end = way * pose(chain.nominal);
  return out;
}

void put(const Vec3& v, double (&out)[3]) { Eigen::Map<Vec3>(static_cast<double*>(out)) = v; }
void put(Complex z, double (&out)[2]) {
  out[0] = z.real();
  out[1] = z.imag();
}

std::optional<PlanarLeg> planar(const Mechanism& m, const HomeLeg& leg) {
  std::vector<HomeJoint> turning, sliding;
  for (const HomeJoint& j : leg.joints) (j.prismatic ? sliding : turning).push_back(j);
  if (turning.size() != 3 || sliding.size() != 1) return std::nullopt;
  const Vec3 w = turning[0].axis;
  for (const HomeJoint& j : leg.joints)
    if (j.axis.cross(w).norm() > parallel) return std::nullopt;
  const auto across = [&](const Vec3& v) { return Vec3(v - w * w.dot(v)); };
  const Vec3 reach = across(turning[2].point - turning[0].point);
  const double least = shortest * m.length;
  if (reach.norm() < least) return std::nullopt;
  const Vec3 u = reach.normalized(), v = w.cross(u);
  const auto plane = [&](const Vec3& x) { return Complex(u.dot(x), v.dot(x)); };
  const Complex a = plane(turning[1].point - turning[0].point), b = plane(turning[2].point - turning[1].point);
  if (std::abs(a) < least || std::abs(b) < least) return std::nullopt;
  const Complex bend = std::conj(a) * b / (std::abs(a) * std::abs(b));
  if (std::abs(bend.imag()) < shortest) return std::nullopt;
  PlanarLeg out{};
  put(u, out.u);
  put(v, out.v);
  put(w, out.w);
  put(turning[0].point, out.first);
  put(leg.end.R.transpose() * (turning[2].point - leg.end.p), out.third);
  put(leg.end.R.transpose() * u, out.heading);
  put(a, out.a);
  put(b * std::conj(bend), out.b);
  out.sum = std::norm(a) + std::norm(b);
  out.inverse = 0.5 / (std::abs(a) * std::abs(b));
  out.branch = bend.imag() > 0 ? 1 : -1;
  out.bend = std::arg(bend);
  out.height = w.dot(turning[2].point);
  turning.push_back(sliding[0]);
  for (std::size_t k = 0; k < 4; ++k) {
    out.home[k] = m.home_coordinates[turning[k].coordinate];
    out.sense[k] = turning[k].axis.dot(w) > 0 ? 1 : -1;
    out.coordinate[k] = turning[k].coordinate;
  }
  return out;
}

}  // namespace

void recognise_planar_legs(const Mechanism& m, FastPlanData& out) {
  const ChainProgram& root = out.chains[static_cast<std::size_t>(out.program.root)];
  Pose start;
  for (int i = root.first; i <= out.program.legs_op; ++i)
    start = start * pose(out.ops[static_cast<std::size_t>(i)].nominal);
  const Op& legs = out.ops[static_cast<std::size_t>(out.program.legs_op)];
  std::vector<PlanarLeg> found;
  for (int k = 0; k < legs.count; ++k) {
    const auto home = at_home(m, out, out.chains[static_cast<std::size_t>(legs.first + k)], start);
    const auto leg = home ? planar(m, *home) : std::nullopt;
    if (!leg) return;
    found.push_back(*leg);
  }
  out.planar = std::move(found);
}

}  // namespace stiffmap
