// SPDX-License-Identifier: MIT
// What a plan owns: the tables that its Program points into.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "../../kernels/program.hpp"
#include "stiffmap/model/mechanism.hpp"

namespace stiffmap {

inline std::int32_t i32(std::size_t n) { return static_cast<std::int32_t>(n); }
inline std::int32_t i32(Index n) { return static_cast<std::int32_t>(n); }

struct FastPlanData {
  Program program{};
  std::vector<Op> ops;
  std::vector<ChainProgram> chains;
  std::vector<LawProgram> laws;
  std::vector<double> knots;
  std::vector<StrokeProgram> strokes;
  std::vector<double> stroke_rows;
  std::vector<CommandErrorProgram> errors;
  std::vector<double> error_knots;
  std::vector<DriveProgram> drives;
  std::vector<CoordinateProgram> coordinates;
  std::vector<LegClosure> legs;
  std::vector<ClosureEquation> equations;
  std::vector<ClosureTerm> terms;
  std::vector<std::int32_t> unknowns, envelope, serial;
  std::vector<double> nearness;  ///< of a redundant machine, per unknown
  std::vector<PlanarLeg> planar;
  std::vector<ArmLeg> arm;  ///< one or none
  std::vector<FirstTurn> first_turn;
  std::vector<ReachProgram> reach;
  std::vector<TipSpringProgram> springs;
  std::vector<PlaceProgram> places;
  std::vector<std::int32_t> place_steps;
  std::vector<SpinProgram> spins;
  std::vector<Op> hanging_ops;  ///< those of `hanging`
  Program hanging{};            ///< spins that weights turn let go
  std::shared_ptr<const std::vector<double>> grid;
};

}  // namespace stiffmap
