// SPDX-License-Identifier: MIT
// Spins that are held (theory C6) although a load turns them: where they come to rest (theory C10).
#pragma once

#include "stiffmap/equilibrium/equilibrium.hpp"
#include "stiffmap/stiffness/stiffness.hpp"

namespace stiffmap {

class Spins {
 public:
  explicit Spins(const Mechanism& m);

  /// The weight of a body turns a spin.
  bool heavy() const { return off_axis_; }
  /// Before any pose: the coordinates that are held, how all others move by a unit of each (columns) at home, and
  /// whether that moves the centre of a body.
  const std::vector<Index>& held() const { return held_; }
  const MatX& motion() const { return motion_; }
  const std::vector<bool>& moves_a_body() const { return moves_a_body_; }
  /// Some load of `p` may turn a spin.
  bool loaded(const Problem& p) const;
  /// From the equilibrium with the spins held to the one where each that a load turns has come to rest in
  /// the least potential energy. False where one does not.
  bool settle(Problem& p, const EquilibriumOptions& options, EquilibriumWorkspace& eq, State& state,
              EquilibriumResult& out);
  /// Holds all of them, as a pose starts.
  void hold() { turning_.clear(); }
  /// The stiffness of a point once those spins are free.
  void release(const NodePoint& point, EquilibriumWorkspace& eq, StiffnessResult& k);
  /// The load decides on this coordinate.
  bool decided(Index coordinate) const;

 private:
  const Mechanism& m_;
  std::vector<Index> held_, turning_;  ///< coordinates; turning: a load decides
  bool off_axis_ = false;              ///< a spin moves the centre of a body
  std::vector<bool> moves_a_body_;     ///< which
  MatX motion_, wrench_;               ///< per held spin: of all coordinates and loop wrenches, by a unit of it
  MatX curve_;                         ///< derivative of the holding moments of those that turn
  VecX moment_;                        ///< that holds each of them
  VecX force_, closure_;

  double noise(const Problem& p) const;
  void move_each(EquilibriumWorkspace& eq);
  void measure(const Problem& p, EquilibriumWorkspace& eq);
};

}  // namespace stiffmap
