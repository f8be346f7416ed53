// SPDX-License-Identifier: MIT
// Recognises arms of six revolutes, the second to fourth parallel and the last two meeting, and takes their numbers at
// home.
#include <cmath>
#include <complex>

#include "closure.hpp"
#include "home_leg.hpp"

namespace stiffmap {
namespace {

constexpr double arm_parallel = 1e-12;
constexpr double arm_regular = 1e-2;  // sines at home of what may be stretched or folded, levers relative to the length

template <std::size_t N>
void store(const Vec3& v, double (&out)[N]) {
  static_assert(N == 3);
  for (int i = 0; i < 3; ++i) out[i] = v[i];
}

/// Where two lines meet; nothing where they don't.
std::optional<Vec3> meeting(const HomeJoint& a, const HomeJoint& b, double length) {
  const Vec3 n = a.axis.cross(b.axis), between = b.point - a.point;
  if (n.norm() < arm_regular || std::abs(between.dot(n)) > 1e-13 * length * n.norm()) return std::nullopt;
  return Vec3(a.point + between.cross(b.axis).dot(n) / n.squaredNorm() * a.axis);
}

/// Sign of the branch on which A cos t + B sin t = A at t = 0; 0 next to its end.
double branch_sign(double A, double B) {
  if (std::abs(B) < arm_regular * std::hypot(A, B)) return 0;
  return B > 0 ? -1 : 1;
}

/// The two arms in the plane across the parallel axes.
bool place_elbow(const std::vector<HomeJoint>& j, double least, ArmLeg& out) {
  const Vec3 u = j[1].axis, lever = j[2].point - j[1].point;
  const Vec3 flat = lever - u * u.dot(lever);
  if (flat.norm() < least) return false;
  const Vec3 along = flat.normalized(), across = u.cross(along);
  using Complex = std::complex<double>;
  const auto plane = [&](const Vec3& v) { return Complex(along.dot(v), across.dot(v)); };
  const Complex a = plane(lever), b = plane(j[3].point - j[2].point);
  if (std::abs(b) < least) return false;
  const Complex bend = std::conj(a) * b / (std::abs(a) * std::abs(b)), straight = b * std::conj(bend);
  if (std::abs(bend.imag()) < arm_regular) return false;
  store(u, out.u);
  store(along, out.along);
  store(across, out.across);
  store(j[1].point, out.second);
  out.a[0] = a.real();
  out.a[1] = a.imag();
  out.b[0] = straight.real();
  out.b[1] = straight.imag();
  out.sum = std::norm(a) + std::norm(b);
  out.inverse = 0.5 / (std::abs(a) * std::abs(b));
  out.bend = std::arg(bend);
  out.branch = bend.imag() > 0 ? 1 : -1;
  return true;
}

std::optional<ArmLeg> arm_leg(const Mechanism& m, const HomeLeg& leg) {
  const std::vector<HomeJoint>& j = leg.joints;
  if (j.size() != 6) return std::nullopt;
  for (const HomeJoint& k : j)
    if (k.prismatic) return std::nullopt;
  const Vec3 u = j[1].axis, w1 = j[0].axis, w5 = j[4].axis, w6 = j[5].axis;
  if (j[2].axis.cross(u).norm() > arm_parallel || j[3].axis.cross(u).norm() > arm_parallel) return std::nullopt;
  const std::optional<Vec3> wrist = meeting(j[4], j[5], m.length);
  ArmLeg out{};
  if (!wrist || !place_elbow(j, arm_regular * m.length, out)) return std::nullopt;
  const Vec3 d = *wrist - j[0].point;
  out.lean1 = u.dot(w1);
  out.height1 = u.dot(d);
  out.side = branch_sign(out.height1 - out.lean1 * w1.dot(d), -u.dot(w1.cross(d)));
  out.lean5 = w5.dot(u) * w5.dot(w6);
  out.A5 = u.dot(w6) - out.lean5;
  out.B5 = u.dot(w5.cross(w6));
  out.flip = branch_sign(out.A5, out.B5);
  if (out.side == 0 || out.flip == 0) return std::nullopt;
  store(w5, out.w5);
  store(w6, out.w6);
  store(*wrist - leg.end.p, out.wrist);
  store(j[3].point - *wrist, out.fourth);
  for (int i = 0; i < 9; ++i) out.end_R[i] = leg.end.R(i % 3, i / 3);
  for (std::size_t k = 0; k < 6; ++k) {
    out.home[k] = m.home_coordinates[j[k].coordinate];
    out.sense[k] = k > 0 && k < 4 && j[k].axis.dot(u) < 0 ? -1 : 1;
    out.coordinate[k] = j[k].coordinate;
  }
  return out;
}

}  // namespace

void recognise_arm(const Mechanism& m, FastPlanData& out) {
  if (out.ops[static_cast<std::size_t>(out.program.legs_op)].count != 1) return;
  const auto home = leg_at_home(m, out, 0);
  if (!home || home->joints.empty()) return;
  const HomeJoint& first = home->joints.front();
  if (!first.prismatic) {
    FirstTurn& turn = out.first_turn.emplace_back();
    store(first.point, turn.point);
    store(first.axis, turn.axis);
    turn.home = m.home_coordinates[first.coordinate];
    turn.coordinate = first.coordinate;
  }
  if (const auto arm = arm_leg(m, *home)) out.arm = {*arm};
}

}  // namespace stiffmap
