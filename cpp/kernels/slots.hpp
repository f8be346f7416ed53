// SPDX-License-Identifier: MIT
// Intermediate results of one block of poses, kept between the passes.
#pragma once

#include "program.hpp"
#include "sym6.hpp"

namespace stiffmap::kernel {

struct JointSlot {
  V3 w, o;  ///< axis and origin, base axes
  V6 F;     ///< transmitted wrench at o
  V6 J, u;  ///< column and row of the rank-one step at its node
  V inverse, y;
  V3 turn;  ///< coupling to the turn of the chain's start, only under gravity
};

struct StiffSlot {                       // a spring or a block: six relative coordinates between two frames
  Frame start;                           ///< frame before it
  M3 Z;                                  ///< spring: moments by its own coordinates
  V3 p;                                  ///< point behind it
  V6 F;                                  ///< transmitted wrench at p
  V L[6][6], inverse[6], X[6][6], y[6];  ///< elimination of its relative twist
  V turn[3][6];                          ///< and its coupling to the turn of the chain's start
};

struct BranchSlot {
  Frame end;
  V6 F;       ///< wrench that acts on its end
  V6 before;  ///< the same before the last step
  V6 kept;    ///< the same at the last load step in equilibrium
  V6 slope;   ///< by the load, and the next two terms of its series along the path
  V6 second, third;
  V6 error;  ///< twist from its end to the end of the block's first branch
  Sym6 K;
  V6 c;
  V6 turn[3];  ///< its wrench by the turn of the block's start, only under gravity
  V6 rest;     ///< residual of its chain at the last pass over all
};

/// The six joints with which a chain without spring or block begins (F12).
struct GroupSlot {
  V inverse[6][6];  ///< from the twist of its end to the joints' steps
  V3 p;             ///< its end
};

/// Stiffness of a spring that varies with a coordinate, row-major.
struct StrokeSlot {
  V K[36];
};

/// All scratch of a thread, laid out once in one piece of memory.
struct Scratch {
  JointSlot* joints;
  StiffSlot* stiff;
  GroupSlot* groups;
  StrokeSlot* strokes;
  BranchSlot* branches;  ///< per chain
  V *x, *z, *dz, *a_base, *tau, *da, *dtau, *closed;
  V* scale;          ///< compliance of a drive where it stands, of the declared one
  V* linear;         ///< with it: slope of a law without its cubic term or corners
  V* curve;          ///< root of the cubic term over that slope, of `by_force`
  V* friction_sign;  ///< sign of dry friction
  V* kept;           ///< z at the last load step in equilibrium
  V* slope;          ///< by the load
  V* second;         ///< and the next two terms of z's series along the path
  V* third;
  V* rest;  ///< step that is taken to first order only
};

/// Branches whose wrench is a state: the first of a block carries what the others leave.
template <class Call>
inline void each_shared_wrench(const Program& P, Scratch& s, const Call& call) {
  for (int i = 0; i < P.op_count; ++i) {
    const Op& op = P.ops[i];
    for (int b = 1; op.kind == OpKind::block && b < op.count; ++b) call(s.branches[op.first + b]);
  }
}

}  // namespace stiffmap::kernel
