// SPDX-License-Identifier: MIT
#include "unloaded.hpp"

#include <algorithm>

namespace stiffmap::unloaded {
namespace {

/// Each drive by what the tip rises with it (theory G4).
void sag(const Mechanism& m, const VecX& x, Problem& p) {
  if (std::all_of(m.drives.begin(), m.drives.end(), [](const Drive& d) { return d.numbers.sag == 0; })) return;
  Frames nominal(m);
  forward(m, Geometry::nominal, x, nominal);
  const Vec3 up = p.gravity.isZero(0) ? Vec3::UnitZ() : Vec3(-p.gravity.normalized());
  for (const Drive& d : m.drives)
    p.base[d.coordinate] -= d.numbers.sag * up.dot(column(m, nominal, d.coordinate, nominal.at(m.tip).p).head<3>());
}

}  // namespace

bool command(const Mechanism& m, const VecX& x, Problem& p) {
  p.friction_sign.setZero();
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    p.base[j] = c.role == Role::spring || c.from_home() ? m.rest[j] : x[j];
  }
  for (const Drive& d : m.drives) {
    const double u = x[d.coordinate];
    p.drive_scale[d.coordinate] = 1 + d.numbers.compliance_slope * (u - m.home_coordinates[d.coordinate]);
    for (const auto& [coordinate, of, error] : d.errors) p.base[coordinate] += error(x[of]);
  }
  sag(m, x, p);
  bool known = true;
  for (std::size_t i = 0; i < m.groups.size(); ++i) {
    const SpringGroup& g = m.groups[i];
    if (g.stroke) known = stiffness_at(*g.stroke, g.matrix, x[g.varies_with], p.springs[i]) && known;
  }
  return known;
}

void start_state(const Mechanism& m, const VecX& x, State& state) {
  state.z.setZero();
  state.lambda.setZero();
  state.charts = {};
  for (Index j = 0; j < m.size(); ++j) {
    const Coordinate& c = m.coordinates[at(j)];
    if (!c.from_home()) continue;
    const Law& law = m.laws[at(c.law)];
    state.z[j] = law.has_knots() ? x[j] - m.rest[j] : law.from_deflection(x[j] - m.rest[j]);
  }
  VecX charted = x;
  if (!keep_off_locks(m, charted, state.charts)) return;
  for (const Ball& b : m.balls) state.z.segment<3>(b.first) += charted.segment<3>(b.first) - x.segment<3>(b.first);
}

Mat6 Unloaded::stiffness(const VecX& x, const NodePoint& point) {
  if (!command(m_, x, problem_)) return Mat6::Constant(nan);
  state_ = State(m_);
  start_state(m_, x, state_);
  linearize(m_, problem_, state_, lin_);
  saddle_.assemble(m_, lin_);
  return point_stiffness(m_, lin_, saddle_, point.node, point.offset, ws_).stiffness;
}

double change(const Mat6& K, const Mat6& before) {
  const Vec6 s = before.diagonal().cwiseAbs().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  return (s.asDiagonal() * (K - before) * s.asDiagonal()).cwiseAbs().maxCoeff();
}

}  // namespace stiffmap::unloaded
