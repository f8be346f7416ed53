// SPDX-License-Identifier: MIT
// A mechanism as plain data that every instruction-set level can read: no Eigen, no templates, no
// code. Chains are lists of operations; a block operation names the chains of its branches.
#pragma once

#include <cstdint>

namespace stiffmap {

enum class OpKind : std::int32_t { revolute, prismatic, spring, block, load };

/// Constant transform before an operation.
struct Constant {
  double p[3], R[9];  ///< R by columns
  std::int32_t has_rotation, has_translation;
};

/// No padding: operations are compared by their bytes.
struct Op {
  OpKind kind;
  std::int32_t coordinate;    ///< first coordinate of a joint or spring; -1 otherwise
  std::int32_t eliminated;    ///< 0: the coordinate is held (rigid drive, locked spin)
  std::int32_t axis;          ///< 0, 1, 2: unit axis; 3: `direction`
  std::int32_t law;           ///< index into laws, -1: none
  std::int32_t first, count;  ///< block: its chains are first .. first+count-1
  std::int32_t wrench;        ///< block: index of the wrench of its second branch
  std::int32_t slot;          ///< place of its intermediate results
  std::int32_t stroke;        ///< spring: index into strokes, -1: K holds everywhere
  double direction[3];
  double K[36], rest[6];     ///< spring
  double mass, com[3];       ///< load: a body's weight
  Constant nominal, actual;  ///< before the operation
};

struct ChainProgram {
  std::int32_t first, count;  ///< operations
  std::int32_t
      first_stiff;     ///< the first spring or block, or the last joint of the group: before it the chain is rigid
  std::int32_t group;  ///< slot of the six joints with which a chain without spring or block begins (F12); -1: none
  std::int32_t still;  ///< nothing before its start moves: it never turns
  Constant nominal, actual;  ///< after the last operation
};

/// Polyline in (a, tau) by knots, or linear with a cubic term: see Law.
struct LawProgram {
  double stiffness, cubic, friction;
  std::int32_t first, count;  ///< knots
};

/// A spring that varies with a coordinate: theory S3. A table's rows: coordinate, then the compliance.
struct StrokeProgram {
  std::int32_t op, coordinate;
  std::int32_t along;         ///< beam: its axis
  std::int32_t first, count;  ///< table: rows; none: a beam
  double at, length, rate, slack;
};
inline constexpr int stroke_row = 37;

/// Error of the commanded coordinate `of`, which moves `coordinate`: the same, or a deviation of its guide.
struct CommandErrorProgram {
  std::int32_t coordinate, of;
  std::int32_t first, count;  ///< knots
  double offset, slope, amplitude, period, phase, reference;
};

struct DriveProgram {
  std::int32_t coordinate, slot, prismatic;
  double home, compliance_slope, force_limit, sag;
};

struct CoordinateProgram {
  double home, lower, upper, unit;
  double stiffness, rest;  ///< of a link spring's direction that is a joint of its own; rest: of a joint's law too
  double friction;         ///< of a free passive joint
  double middle;           ///< of a ball joint's second coordinate: its axes are perpendicular there
  std::int32_t ball;       ///< it is one: 1 of axes that are meant, 2 of a free ball
  std::int32_t role, locked, law, from_home;
  std::int32_t by_force;  ///< a hardening law of a joint: its parameter is the deflection that its force has without it
};

/// One closure equation set of a leg: the leg's end or a loop inside it.
struct ClosureTerm {
  std::int32_t unknown;  ///< local to the leg
  std::int32_t slot;     ///< of the joint's operation
  std::int32_t prismatic;
  double sign;  ///< +1 moves the end, -1 the loop's primary
};
struct ClosureEquation {
  std::int32_t chain, primary;  ///< chains whose ends meet; primary < 0: the commanded frame
  std::int32_t first, count;    ///< terms
};
struct LegClosure {
  std::int32_t first_equation, equations;
  std::int32_t first_unknown, unknowns;  ///< into unknown coordinates
};

/// A leg of three parallel revolutes and a slide along them closes in closed form (docs/fast_path.md,
/// Closure). Base axes, all relative to home; u, v, w right-handed, u from the first to the third axis.
struct PlanarLeg {
  double u[3], v[3], w[3];
  double first[3];           ///< a point of the first axis
  double third[3];           ///< a point of the third axis in the legs' end frame
  double heading[3];         ///< u in the legs' end frame
  double a[2], b[2];         ///< first to second axis, second to third turned to the sine's zero; along u, v
  double sum, inverse;       ///< |a|^2 + |b|^2, 1/(2 |a| |b|)
  double branch;             ///< sign of the sine at home
  double bend, height;       ///< angle of (cosine, sine) and slide of the third point at home
  double home[4], sense[4];  ///< revolutes in order, then the slide
  std::int32_t coordinate[4];
};

/// The first joint of an arm that turns, at home in base axes: towards a pose, it is where the arm may begin.
struct FirstTurn {
  double point[3], axis[3], home;
  std::int32_t coordinate;
};

/// An arm of six revolutes, the second to fourth parallel, the last two meeting, closes in closed form. Base axes, at
/// home; angles count from there.
struct ArmLeg {
  double u[3], along[3], across[3];  ///< of the parallel axes, and of the plane across them
  double second[3];                  ///< a point of the second axis
  double w5[3], w6[3];
  double wrist[3], fourth[3];  ///< where the last axes meet, from the leg's end; a point of the fourth axis from there
  double end_R[9];             ///< the leg's end, by columns
  double lean1, height1;       ///< u·w1; u·(wrist - first)
  double A5, B5, lean5;        ///< u·R(w5, t) w6 = A5 cos t + B5 sin t + lean5
  double a[2], b[2];           ///< second to third axis, third to fourth turned to the sine's zero; along, across
  double sum, inverse;         ///< |a|^2 + |b|^2, 1/(2 |a| |b|)
  double bend;                 ///< angle at the third axis
  double side, flip, branch;   ///< signs at home: of the shoulder, the wrist, the elbow
  double home[6], sense[6];
  std::int32_t coordinate[6];
};

/// How far a leg can stretch beyond its first slides: from the centre of its first turning joint, in base axes, to that
/// of its last one, in the tip's frame. A target further away, but for the slides, is out of reach for sure.
struct ReachProgram {
  double first[3], last[3];
  double along[3][3];  ///< slides before the first turning joint, made orthonormal
  std::int32_t slides, known;
  double length;  ///< of all that is between the two centres
};

/// An external spring at the tip (theory S2): straight, from a point of the tip's body to an anchor in the base. A
/// cable has a winch (theory B1-B4).
struct TipSpringProgram {
  double offset[3], anchor[3], stiffness, length;
  std::int32_t tension_only;
  std::int32_t coordinate;                      ///< of the winch: the free length; -1: none
  double axis[3], radius;                       ///< pulley
  double fixed, per_length;                     ///< compliance: fixed + per_length * free length
  double nominal_offset[3], nominal_anchor[3];  ///< as the controller believes
  double stretch, slope;                        ///< its command: (length - stretch) * slope
};

/// A named point. Of the tip's body: its frame in the tip's. Of another: the steps that lead to its body from the base
/// (operations; ~chain: the end of a chain), then its frame in the body's.
struct PlaceProgram {
  std::int32_t on_tip, first, count;
  std::int32_t turned;  ///< by an error: nominal and actual rotation differ
  Constant nominal, actual;
};

/// A rod's free turn about the line between its joints: the coordinate that is held and the one that turns back, both
/// about that line, in the order of the chain.
struct SpinProgram {
  std::int32_t chain, first, last;  ///< operations of the two
  std::int32_t held;                ///< the coordinate that is held
  std::int32_t heavy;               ///< it moves the centre of a body: under gravity it hangs
};
inline constexpr int most_spins = 24;

struct Program {
  const Op* ops;
  const ChainProgram* chains;
  const LawProgram* laws;
  const double* knots;  ///< (a, tau, z) triples
  const StrokeProgram* strokes;
  const double* stroke_rows;
  const CommandErrorProgram* errors;
  const double* error_knots;  ///< (coordinate, error) pairs
  const DriveProgram* drives;
  const CoordinateProgram* coordinates;
  const LegClosure* legs;
  const ClosureEquation* equations;
  const ClosureTerm* terms;
  const ReachProgram* reach;        ///< one per leg where legs close one by one
  const TipSpringProgram* springs;  ///< external ones
  const PlaceProgram* places;       ///< named points; the first is the tip
  const std::int32_t* place_steps;
  const SpinProgram* spins;    ///< those that are held; none where weights turn none of them
  const Program* hanging;      ///< the same machine, spins that weights turn let go; null where there are none
  const std::int32_t* serial;  ///< arm of joints alone: its joints that yield and its bodies, from the base
  const std::int32_t* unknowns;
  const std::int32_t* envelope;  ///< per unknown: the first one of its leg that shares an equation with one up to it
  const double* nearness;        ///< per unknown: weight of its distance from home (F25); null: a pose decides all
  const PlanarLeg* planar;       ///< one per leg, or null: the closure starts from the grid
  const ArmLeg* arm;             ///< of the only leg, or null
  const FirstTurn* first_turn;   ///< the same
  const double* grid;            ///< closure starts: nodes x row of unknowns of all legs, NaN where unreachable
  std::int32_t op_count, chain_count, error_count, drive_count, coordinate_count, leg_count, unknown_count,
      spring_count, spin_count, serial_count, serial_joints;  ///< serial_joints -1: no such arm
  std::int32_t root, legs_op;                                 ///< root chain; the legs' block operation
  std::int32_t joint_slots, stiff_slots, group_slots, stroke_count;
  std::int32_t closes;         ///< 1: leg by leg, 2: all at once (`legs` is then the whole machine)
  std::int32_t task[6];        ///< commanded pose components, rotations about the axes of the commanded frame
  std::int32_t open_task;      ///< some are not
  std::int32_t sags;           ///< some drives sag
  std::int32_t starts_linear;  ///< a law with knots or friction: Newton starts with all laws linear
  std::int32_t hardens;        ///< a law with a cubic term
  std::int32_t bends;          ///< laws with corners, and none of them sticks: a deflection says the force
  std::int32_t parallel;       ///< branches share a load: how is known only when they have moved
  std::int32_t deficient;      ///< arm of joints alone that cannot move its tip in every direction: no stiffness there
  std::uint32_t flag_force, flag_range, flag_limit, flag_lock, flag_always, flag_stepped, flag_unverified;
  std::int32_t grid_n[3], grid_row;  ///< nodes along each axis; numbers per node, a multiple of 8
  double grid_low[3], grid_step[3];
  std::int32_t free_balls;                      ///< there are some
  double length, stiffness, near_lock, narrow;  ///< spreads of a ball's axes: a flag, another chart
  std::int32_t floating;                        ///< no leg, no spring: cables alone carry the tip
  std::int32_t free[6];                         ///< of such a platform: its free joints, along and about the base axes
  double guide[3], tip_from_body[3];            ///< where these joints start; the tip from their end at home, base axes
  double weight, weight_at[3];                  ///< mass of the platform, its centre in the tip's frame
  std::uint32_t flag_slack;
  double softest;               ///< lowest stiffness of a spring or drive, in multiples of `stiffness`; at most 1
  double home_p[3], home_R[9];  ///< tip pose at home, R by columns
};

/// How long a block of poses may take: a lane that needs more is left to a later pass, so that it holds up only its
/// like.
enum class Patience : std::int32_t { quick, leaps, path, long_path };

/// Whether a load keeps its direction as the tip turns, turns with it, or has the conservative moment (theory E6).
enum class LoadTurns : std::int32_t { dead, follower, semitangential };

/// A load besides the one at the point of the answer, at another place of the tip's body.
struct FurtherLoad {
  std::int32_t place;
  LoadTurns turns;
};

/// What each pose asks, row-major.
struct KernelInput {
  std::int64_t count;
  const double* position;  ///< count x 3
  const double* rotation;  ///< count x 9, or one for all
  const double* wrench;    ///< count x (1 + load_count) x 6, the first at the point; or those of one pose for all
  std::int32_t one_rotation, one_wrench;
  const double* start;  ///< count x coordinates: closed configurations; null: interpolate the grid
  double gravity[3];
  std::int32_t point;  ///< place of the tip's body where stiffness is answered
  std::int32_t read_count, load_count;
  const std::int32_t* reads;  ///< further places whose displacement is wanted
  const FurtherLoad* loads;
  const std::int64_t*
      index;  ///< the poses to solve, null: all; start, position and rotation go by place if start is given
  Patience patience;
  LoadTurns turns;  ///< whether the wrench at the point turns with the tip
  std::int32_t max_iterations;
  double tolerance;
  const Program* const* perturbed;    ///< variants of the program with the same operations
  const std::int32_t* perturbed_leg;  ///< per variant: the only leg that differs from the program; -1: anything
  std::int32_t perturbed_count;
};

/// How a pose left the kernels.
inline constexpr std::uint8_t pose_left = 0;  ///< to the reference path
inline constexpr std::uint8_t pose_solved = 1, pose_unstable = 2, pose_unreachable = 3;
inline constexpr std::uint8_t pose_ended = 4;  ///< the path of equilibria ends before the whole load
inline constexpr std::uint8_t pose_slow = 5;   ///< does not close at once: to be closed in leaps, together with others
inline constexpr std::uint8_t pose_heavy = 6;  ///< closed, but its load takes long: to be followed in steps
inline constexpr std::uint8_t pose_nowhere = 8;  ///< beyond the end of the path of equilibria nothing was found
inline constexpr std::uint8_t pose_loose = 7;    ///< solved, but a joint plays inside its gap

/// Row-major answers; null: not wanted. `done`: how the pose left the kernels. Displacement: count x (1 + read_count)
/// x 6.
struct KernelOutput {
  double *displacement, *stiffness, *compliance, *effort, *leg_wrench, *coordinates;
  double* free_twists;  ///< count x 36: the first column, of poses that are loose
  double* perturbed;    ///< count x variants x 6: displacement after one step from the base's answer
  std::uint8_t* done;
  std::uint32_t* flags;
  std::int32_t* iterations;
};

/// Layout that both sides of the border were compiled with: a stale kernel library is refused.
inline constexpr std::int64_t program_layout =
    sizeof(Program) + 31 * sizeof(KernelInput) + 37 * sizeof(KernelOutput) + 41 * sizeof(Op) +
    43 * sizeof(CoordinateProgram) + 47 * sizeof(DriveProgram) + 53 * sizeof(LawProgram) + 59 * sizeof(ClosureTerm) +
    71 * sizeof(ReachProgram) + 73 * sizeof(TipSpringProgram) + 67 * sizeof(ChainProgram) + 61 * sizeof(PlanarLeg) +
    71 * sizeof(StrokeProgram) + 79 * sizeof(ArmLeg) + 83 * sizeof(PlaceProgram) + 89 * sizeof(FurtherLoad) +
    97 * sizeof(SpinProgram);

/// The one symbol that each level exports. Poses begin .. end-1; `scratch` of scratch_size() bytes.
struct KernelTable {
  const char* level;
  std::int32_t lanes;
  std::int64_t layout;
  std::int64_t (*scratch_size)(const Program*);
  void (*run)(const Program*, const KernelInput*, const KernelOutput*, std::int64_t begin, std::int64_t end,
              void* scratch);
};

}  // namespace stiffmap
