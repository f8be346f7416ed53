// SPDX-License-Identifier: MIT
// Recognises legs of three parallel revolutes and a slide along them, and takes their numbers at home.
#include <cmath>
#include <complex>
#include <optional>

#include "closure.hpp"
#include "home_leg.hpp"

namespace stiffmap {
namespace {

using Complex = std::complex<double>;

constexpr double parallel = 1e-12;
constexpr double shortest = 1e-3;  // arms relative to the mechanism's length, sine of the bend at home

void write(const Vec3& v, double (&out)[3]) { Eigen::Map<Vec3>(static_cast<double*>(out)) = v; }
void write(Complex z, double (&out)[2]) {
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
  write(u, out.u);
  write(v, out.v);
  write(w, out.w);
  write(turning[0].point, out.first);
  write(leg.end.R.transpose() * (turning[2].point - leg.end.p), out.third);
  write(leg.end.R.transpose() * u, out.heading);
  write(a, out.a);
  write(b * std::conj(bend), out.b);
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
  const Op& legs = out.ops[static_cast<std::size_t>(out.program.legs_op)];
  std::vector<PlanarLeg> found;
  for (int k = 0; k < legs.count; ++k) {
    const auto home = leg_at_home(m, out, k);
    const auto leg = home ? planar(m, *home) : std::nullopt;
    if (!leg) return;
    found.push_back(*leg);
  }
  out.planar = std::move(found);
}

}  // namespace stiffmap
