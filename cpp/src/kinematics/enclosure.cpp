// SPDX-License-Identifier: MIT
#include "stiffmap/kinematics/enclosure.hpp"

#include <cmath>

namespace stiffmap {
namespace {

constexpr double cushion = 1e-11;  // of the length: for round-off
constexpr double most_turn = 1.0;  // rad of a frame within a cell
constexpr int most_rounds = 8;

bool is_revolute(const Mechanism& m, Index j) { return m.coordinates[at(j)].type == JointType::revolute; }

bool moves(const Coordinate& c) { return c.role == Role::actuator || (c.role == Role::passive && !c.locked); }

/// Approximate inverse of A from the left; its defect is accounted for by whoever uses it.
bool left_inverse(const MatX& A, MatX& C) {
  const MatX N = A.transpose() * A;
  Cholesky cholesky;
  if (!cholesky.compute(N)) return false;
  MatX correction;
  cholesky.solve(A.transpose(), C);
  cholesky.solve(A.transpose() - N * C, correction);
  C += correction;
  return C.allFinite();
}

}  // namespace

std::string Encloser::missing(const Mechanism& m) {
  if (m.redundancy > 0) return "a pose leaves some drives open";
  int turned = 0;
  for (std::size_t i = 3; i < 6; ++i) turned += m.task[i];
  return turned == 0 || turned == 3 ? "" : "some rotations of the task are open";
}

Encloser::Encloser(const Mechanism& m) {
  std::vector<Index> place(at(m.size()), -1);
  for (Index j = 0; j < m.size(); ++j) {
    if (!moves(m.coordinates[at(j)])) continue;
    place[at(j)] = static_cast<Index>(unknown_.size());
    unknown_.push_back(j);
  }
  const auto own = [&](const std::vector<Index>& path, std::size_t from, Arm& arm) {
    for (std::size_t i = from; i < path.size(); ++i) {
      if (place[at(path[i])] < 0) continue;
      arm.joint.push_back(path[i]);
      arm.unknown.push_back(place[at(path[i])]);
    }
    const Index n = static_cast<Index>(arm.joint.size());
    arm.w.resize(3, n);
    arm.c.resize(3, n);
    arm.size.resize(n);
    arm.turn.resize(n);
    arm.lever.resize(n);
  };
  own(m.path[at(m.tip)], 0, tip_);
  for (const Loop& l : m.loops) {  // in the frame that both ends share
    const auto &a = m.path[at(l.primary)], &b = m.path[at(l.end)];
    std::size_t shared = 0;
    while (shared < a.size() && shared < b.size() && a[shared] == b[shared]) ++shared;
    loops_.emplace_back();
    own(a, shared, loops_.back()[0]);
    own(b, shared, loops_.back()[1]);
  }
}

/// f(arm, sign, first row, the other side or null) for every arm of the equations.
template <class Each>
void Encloser::each(Each&& f) {
  f(tip_, 1.0, Index{0}, static_cast<Arm*>(nullptr));
  for (std::size_t l = 0; l < loops_.size(); ++l)
    for (std::size_t side = 0; side < 2; ++side)
      f(loops_[l][side], side ? 1.0 : -1.0, 6 + 6 * static_cast<Index>(l), &loops_[l][1 - side]);
}

void Encloser::build(const Mechanism& m, const Frames& frames, Index end, Arm& arm) const {
  const Vec3& p = frames.at(end).p;
  for (std::size_t i = 0; i < arm.joint.size(); ++i) {
    const Index j = arm.joint[i], k = static_cast<Index>(i);
    arm.w.col(k) = frames.axis.col(j);
    arm.c.col(k) = is_revolute(m, j) ? Vec3(arm.w.col(k).cross(p - frames.origin.col(j))) : Vec3(arm.w.col(k));
    arm.size[k] = arm.c.col(k).norm();
  }
}

/// How far axes and levers change when each unknown moves by up to its swing: joints towards the base turn the
/// whole, those towards the end move the end in the joint's own frame.
void Encloser::bound(const Mechanism& m, const VecX& swing, Arm& arm) const {
  const Index n = static_cast<Index>(arm.joint.size());
  double turn = 0;
  for (Index k = 0; k < n; ++k) {
    arm.turn[k] = turn;
    if (is_revolute(m, arm.joint[at(k)])) turn += swing[arm.unknown[at(k)]];
  }
  arm.whole = turn;
  double moved = 0;
  for (Index k = n - 1; k >= 0; --k) {
    const double s = swing[arm.unknown[at(k)]];
    if (is_revolute(m, arm.joint[at(k)])) {
      moved += s * (arm.size[k] + moved);
      arm.lever[k] = moved;
    } else {
      arm.lever[k] = 0;
      moved += s;
    }
  }
}

/// Adds sign times the columns of an end and their radii; `extra`: relative change of rows of rotation.
void Encloser::columns(const Mechanism& m, const Arm& arm, double sign, Index row, double extra, MatX& value,
                       MatX& radius) const {
  for (std::size_t i = 0; i < arm.joint.size(); ++i) {
    const Index u = arm.unknown[i], k = static_cast<Index>(i);
    value.col(u).segment<3>(row) += sign * arm.c.col(k);
    radius.col(u).segment<3>(row).array() += arm.turn[k] * arm.size[k] + arm.lever[k];
    if (!is_revolute(m, arm.joint[i])) continue;
    value.col(u).segment<3>(row + 3) += sign * arm.w.col(k);
    radius.col(u).segment<3>(row + 3).array() += arm.turn[k] + extra;
  }
}

/// Adds the derivatives of the columns along the three directions of `slope`, known to `slack`. `centre`: the
/// values too, else only their radii.
void Encloser::second(const Mechanism& m, const Arm& arm, double sign, Index row, const MatX& slope, const MatX& slack,
                      bool centre, Bend& bend) const {
  const Index n = static_cast<Index>(arm.joint.size());
  const auto add = [&](Index i, Index by, Index from, const Vec3& h, double size, double change) {
    for (Index k = 0; k < 3; ++k) {
      if (centre) bend.at[at(k)].col(i).segment<3>(from) += sign * h * slope(by, k);
      else
        bend.radius[at(k)].col(i).segment<3>(from).array() +=
            change * (std::abs(slope(by, k)) + slack(by, k)) + size * slack(by, k);
    }
  };
  for (Index a = 0; a < n; ++a) {  // a towards the base, b towards the end
    if (!is_revolute(m, arm.joint[at(a)])) continue;
    const Index up = arm.unknown[at(a)];
    for (Index b = a; b < n; ++b) {
      const Index down = arm.unknown[at(b)];
      const double between = arm.turn[b] - arm.turn[a];
      const Vec3 h = arm.w.col(a).cross(arm.c.col(b));
      const double change = arm.turn[a] * h.norm() + between * arm.c.col(b).norm() + arm.lever[b];
      add(down, up, row, h, h.norm(), change);
      if (a == b) continue;
      add(up, down, row, h, h.norm(), change);
      if (!is_revolute(m, arm.joint[at(b)])) continue;
      const Vec3 g = arm.w.col(a).cross(arm.w.col(b));
      add(down, up, row + 3, g, g.norm(), arm.turn[a] * g.norm() + between);
    }
  }
}

/// Angles as lengths, in rows and columns; rows that the task leaves open are zero.
void Encloser::scale(const Mechanism& m, MatX& M) const {
  for (std::size_t u = 0; u < unknown_.size(); ++u) M.col(static_cast<Index>(u)) /= m.unit(unknown_[u]);
  scale_angles(m, M);
  for (Index i = 0; i < 6; ++i)
    if (!m.task[at(i)]) M.row(i).setZero();
}

/// (I - E)^-1 b for E >= 0; false unless that proves the spectral radius of E to be below one.
bool Encloser::Majorant::compute(const MatX& E) {
  const Index n = E.rows();
  lu_.compute(MatX::Identity(n, n) - E);
  VecX one;
  lu_.solve(VecX::Ones(n), one);
  return one.minCoeff() > 0 && (one - E * one).minCoeff() > 0.5;
}

/// Image of `rest` under Krawczyk's operator about x_centre + G d, unknowns within `step` of the centre there.
/// Leaves the change of A over the cell in change_.
bool Encloser::widen(const Mechanism& m, const Vec3& half, const VecX& step, const VecX& rest, VecX& image) {
  const Index n = static_cast<Index>(unknown_.size()), rows = A_.rows();
  VecX unit(n);
  for (Index u = 0; u < n; ++u) unit[u] = m.unit(unknown_[at(u)]);
  const VecX swing = (step + rest).cwiseQuotient(unit), left = rest.cwiseQuotient(unit);
  MatX slope = G_.leftCols(3);
  for (Index u = 0; u < n; ++u) slope.row(u) /= unit[u];
  const MatX none = MatX::Zero(n, 3);
  for (MatX& r : bend_.radius) r.setZero(rows, n);
  bool small = true;
  each([&](Arm& arm, double sign, Index row, Arm*) {
    arm.size = arm.c.colwise().norm();
    bound(m, swing, arm);
    small = small && arm.whole < most_turn;
    second(m, arm, sign, row, slope, none, false, bend_);
  });
  if (!small) return false;
  // the equations' second-order part along G d: exact at the centre, its change as a radius
  MatX change = MatX::Zero(rows, n);
  for (std::size_t k = 0; k < 3; ++k) {
    scale(m, bend_.radius[k]);
    change += half[static_cast<Index>(k)] * bend_.radius[k];
  }
  VecX curved = change * step;  // of A(x) G d
  VecX extra = VecX::Zero(rows);
  VecX twisted = VecX::Zero(rows);
  for (Index i = 3; i < rows; i += 6) {
    // rows of rotation: the skew part's Jacobian differs from the turn by the misorientation
    double most = 0;
    for (Index r = i; r < i + 3; ++r) most += (lost_.row(r).sum() + curved[r]) / m.length;
    extra.segment(i, 3).setConstant(0.1 * most * most * m.length);
    twisted.segment(i, 3).setConstant(0.5 * most);
  }
  MatX value = MatX::Zero(rows, n), radius = MatX::Zero(rows, n);
  each([&](Arm& arm, double sign, Index row, Arm* other) {
    arm.size += (arm.turn.array() * arm.size.array()).matrix() + arm.lever;
    double turned = twisted[row + 3];
    for (const Arm* side : {static_cast<const Arm*>(&arm), static_cast<const Arm*>(other)})
      if (side)
        for (std::size_t i = 0; i < side->joint.size(); ++i)
          if (is_revolute(m, side->joint[i])) turned += left[side->unknown[i]];
    bound(m, left, arm);
    columns(m, arm, sign, row, turned, value, radius);
  });
  scale(m, radius);
  change_ = change + radius;
  image = q_ + absC_ * (0.5 * curved + extra + change_ * rest) + defect_ * (step + rest) + bent_ * rest;
  image.array() += cushion * m.length;
  return image.allFinite();
}

bool Encloser::exists(const Mechanism& m, const Vec3& half) {
  const Index n = static_cast<Index>(unknown_.size()), rows = A_.rows();
  q_.resize(0);
  if (!left_inverse(A_, C_)) return false;
  absC_ = C_.cwiseAbs();
  defect_ = (C_ * A_ - MatX::Identity(n, n)).cwiseAbs();
  if (!(defect_.maxCoeff() < 1e-6)) return false;
  MatX B = MatX::Zero(rows, G_.cols());
  B.topRows(6) = lost_.topRows(6);
  G_ = C_ * B;
  // along the cell's axes, exact at the centre
  MatX slope = G_.leftCols(3);
  for (Index u = 0; u < n; ++u) slope.row(u) /= m.unit(unknown_[at(u)]);
  for (MatX& b : bend_.at) b.setZero(rows, n);
  each([&](Arm& arm, double sign, Index row, Arm*) {
    arm.turn.setZero();
    arm.lever.setZero();
    second(m, arm, sign, row, slope, slope, true, bend_);
  });
  lost_ = MatX::Zero(rows, 1);
  q_ = VecX::Zero(n);
  bent_.setZero(n, n);
  for (std::size_t k = 0; k < 3; ++k) {
    scale(m, bend_.at[k]);
    P_[k] = C_ * bend_.at[k];
    const double h = half[static_cast<Index>(k)];
    q_ += 0.5 * h * (P_[k] * G_.leftCols(3)).cwiseAbs() * half;
    lost_ += h * (bend_.at[k] * G_.leftCols(3)).cwiseAbs() * half;
    bent_ += h * P_[k].cwiseAbs();
  }
  const VecX step = G_.leftCols(3).cwiseAbs() * half;
  VecX rest = 1.2 * q_, image;
  rest.array() += 10 * cushion * m.length;
  bool found = false;
  for (int round = 0; round < most_rounds; ++round) {
    if (!widen(m, half, step, rest, image)) return false;
    if ((image.array() < rest.array()).all()) {
      found = true;
      break;
    }
    rest = 1.2 * image;
  }
  if (!found) return false;
  rest_ = rest;
  widen(m, half, step, rest_, image);
  rest_ = image;                                     // still holds every solution
  E_.noalias() = absC_ * change_ + defect_ + bent_;  // of C A - I over the cell
  if (!majorant_.compute(E_)) return false;
  dG_ = majorant_.solve(E_ * G_.cwiseAbs());
  return dG_.allFinite();
}

void Encloser::enclose(const Mechanism& m, const Frames& frames, const VecX& x, const Mat3& axes, const Vec3& half,
                       Index slopes, const std::vector<Index>& watched, Enclosure& out) {
  out.enclosed = false;
  out.bend.setConstant(nan);
  if (!x.allFinite()) return;
  const Index n = static_cast<Index>(unknown_.size()), rows = 6 + m.closures();
  build(m, frames, m.tip, tip_);
  for (std::size_t l = 0; l < loops_.size(); ++l) {
    build(m, frames, m.loops[l].primary, loops_[l][0]);
    build(m, frames, m.loops[l].end, loops_[l][1]);
  }
  A_.setZero(rows, n);
  MatX unused = MatX::Zero(rows, n);
  each([&](Arm& arm, double sign, Index row, Arm*) {
    arm.turn.setZero();
    arm.lever.setZero();
    columns(m, arm, sign, row, 0.0, A_, unused);
  });
  scale(m, A_);
  G_.resize(n, slopes);
  lost_ = MatX::Zero(6, slopes);
  lost_.topLeftCorner<3, 3>() = axes;
  if (slopes == 6) lost_.bottomRightCorner<3, 3>() = m.length * Mat3::Identity();
  for (Index i = 0; i < 6; ++i)
    if (!m.task[at(i)]) lost_.row(i).setZero();
  const bool found = exists(m, half);
  if (q_.size() == n)
    for (std::size_t k = 0; k < 3; ++k)
      out.bend[static_cast<Index>(k)] =
          half[static_cast<Index>(k)] * (P_[k] * G_.leftCols(3)).cwiseAbs().rowwise().sum().maxCoeff();
  if (!found) return;
  // slopes' own change: their bends over the whole cell
  const VecX step = G_.leftCols(3).cwiseAbs() * half;
  VecX unit(n);
  for (Index u = 0; u < n; ++u) unit[u] = m.unit(unknown_[at(u)]);
  const VecX swing = (step + rest_).cwiseQuotient(unit);
  const MatX slope = unit.cwiseInverse().asDiagonal() * G_.leftCols(3);
  const MatX slack = unit.cwiseInverse().asDiagonal() * dG_.leftCols(3);
  for (MatX& r : bend_.radius) r.setZero(rows, n);
  each([&](Arm& arm, double sign, Index row, Arm*) {
    arm.size = arm.c.colwise().norm();
    bound(m, swing, arm);
    second(m, arm, sign, row, slope, slack, false, bend_);
  });
  MatX total = MatX::Zero(n, slopes);
  std::array<MatX, 3> change;
  for (std::size_t k = 0; k < 3; ++k) {
    scale(m, bend_.radius[k]);
    change[k] = -P_[k] * G_;
    const MatX right =
        E_ * change[k].cwiseAbs() + P_[k].cwiseAbs() * dG_ + absC_ * (bend_.radius[k] * (G_.cwiseAbs() + dG_));
    total += half[static_cast<Index>(k)] * majorant_.solve(right);
  }
  if (!total.allFinite()) return;
  out.G.setZero(m.size(), slopes);
  out.slack.setZero(m.size(), slopes);
  out.radius.setZero(m.size());
  for (MatX& c : out.change) c.setZero(m.size(), slopes);
  VecX full = VecX::Zero(m.size());
  for (Index u = 0; u < n; ++u) {
    const Index j = unknown_[at(u)];
    out.G.row(j) = G_.row(u) / unit[u];
    out.slack.row(j) = total.row(u) / unit[u];
    out.slack.row(j).array() += cushion / unit[u];
    out.radius[j] = rest_[u] / unit[u];
    for (std::size_t k = 0; k < 3; ++k) out.change[k].row(j) = change[k].row(u) / unit[u];
    full[j] = swing[u];
  }
  out.moved.setZero(static_cast<Index>(watched.size()));
  for (std::size_t i = 0; i < watched.size(); ++i) {
    const Vec3& p = frames.at(watched[i]).p;
    const auto& path = m.path[at(watched[i])];
    double moved = 0;
    for (auto j = path.rbegin(); j != path.rend(); ++j) {
      if (full[*j] == 0) continue;  // springs: their axes are not in the frames
      moved += is_revolute(m, *j) ? full[*j] * (frames.axis.col(*j).cross(p - frames.origin.col(*j)).norm() + moved)
                                  : full[*j];
    }
    out.moved[static_cast<Index>(i)] = moved;
  }
  out.enclosed = true;
}

}  // namespace stiffmap
