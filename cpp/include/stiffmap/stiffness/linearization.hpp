// SPDX-License-Identifier: MIT
// Residual and exact tangent of the equilibrium problem at one state: the one linearisation that the
// Newton solver and the stiffness (25) of the paper share (theory E1-E6).
#pragma once

#include <vector>

#include "stiffmap/kinematics/kinematics.hpp"
#include "stiffmap/model/load.hpp"

namespace stiffmap {

/// Everything that is given: commanded drives, gravity, wrenches (base axes, N and N·m).
struct Problem {
  explicit Problem(const Mechanism& m)
      : base(VecX::Zero(m.size())),
        drive_scale(VecX::Ones(m.size())),
        friction_sign(VecX::Zero(m.size())),
        misfit(VecX::Zero(m.closures())) {
    for (const SpringGroup& g : m.groups) springs.push_back(g.matrix.stiffness);
  }
  VecX base;                  ///< value of each coordinate at zero deflection
  VecX drive_scale;           ///< factor on the compliance of each law
  VecX friction_sign;         ///< of the deflection without friction: set by the linear start, 0 before
  std::vector<Mat6> springs;  ///< stiffness of each link at the command (in its own basis)
  VecX misfit;                ///< closure error that the digits of the input leave at the command (theory C9)
  Vec3 gravity = Vec3::Zero();
  std::vector<LoadPoint> load_points;
  std::vector<Vec6> wrenches;
  std::vector<Mat3> load_frames;  ///< per load point: its body at the command; where missing: base axes
  double factor = 1;              ///< of wrenches and gravity: the load step
  bool secant_laws = false;       ///< take every law as linear: the first iteration of a cold start
  bool first_order = false;       ///< leave the load out of the tangent: that iteration is linear statics
  bool unpulled = false;          ///< leave external springs at the tip out
  bool is_nonconservative() const;
  /// Rotation since the command of the body of load i, which is now at R.
  Mat3 turn(std::size_t i, const Mat3& R) const;
  /// Wrench i (base axes, full load) as it acts on its body, which is now at R.
  Vec6 wrench_at(std::size_t i, const Mat3& R) const;
};

/// Unknowns: law parameters or plain coordinates z, and the wrenches of the loops.
struct State {
  explicit State(const Mechanism& m) : z(VecX::Zero(m.size())), lambda(VecX::Zero(m.closures())) {}
  VecX z, lambda;
  Charts charts;  ///< by which the coordinates of free balls count
};

/// What a coordinate is at this state.
enum class Kind : std::uint8_t { fixed, free, elastic };

struct Linearization {
  explicit Linearization(const Mechanism& m);

  Frames frames;
  VecX x;         ///< coordinates
  VecX tau;       ///< spring, drive and joint reactions
  VecX da, dtau;  ///< tangent of each law with respect to z (1 and 0 without a law)
  VecX r, e;      ///< force balance per coordinate, closure error per loop
  MatX K;         ///< spring stiffness, in x
  MatX H;         ///< Hessian d(J^T F)/dx of all loads, in x
  MatX J;         ///< closures by coordinates: loop end minus primary
  std::vector<Kind> kind;

  /// Jacobian of point `offset` of `node`: 6 x coordinates.
  void point_jacobian(const Mechanism& m, Index node, const Vec3& offset, Eigen::Ref<MatX> out) const;
};

void linearize(const Mechanism& m, const Problem& problem, const State& state, Linearization& out);

}  // namespace stiffmap
