// SPDX-License-Identifier: MIT
// Where a named point is: rigidly with the tip, or along the operations that lead to its body.
#pragma once

#include "angles.hpp"
#include "frames.hpp"

namespace stiffmap::kernel {

/// Rotation from where the tip's body stood at the command to where it is, R, as a place of it turned.
inline V3 rotation_since(const PlaceProgram& place, const M3& command, const M3& R) {
  if (!place.turned) return rotation_between(command, R);
  return rotation_between(command * constant_rotation(place.nominal.R), R * constant_rotation(place.actual.R));
}

/// Frame of a place, at coordinates x and the frame of the tip.
template <Build B>
inline Frame frame_of(const Program& P, const PlaceProgram& place, const V* x, const Frame& tip) {
  const auto constant = [](const auto& of) -> const Constant& { return B == Build::nominal ? of.nominal : of.actual; };
  const V o = splat(0), l = splat(1);
  Frame f = place.on_tip ? tip : Frame{{o, o, o}, {{{l, o, o}, {o, l, o}, {o, o, l}}}};
  for (int k = place.first; k < place.first + place.count; ++k) {
    const std::int32_t step = P.place_steps[k];
    if (step < 0) {
      apply(constant(P.chains[~step]), f);
      continue;
    }
    const Op& op = P.ops[step];
    apply(constant(op), f);
    if (op.kind <= OpKind::prismatic) {
      JointSlot passed;
      move_joint(op, x[op.coordinate], f, passed);
    } else if (op.kind == OpKind::spring && B == Build::actual) {
      StiffSlot passed;
      move_spring(x + op.coordinate, f, passed);
    }
  }
  apply(constant(place), f);
  return f;
}

}  // namespace stiffmap::kernel
