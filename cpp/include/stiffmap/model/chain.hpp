// SPDX-License-Identifier: MIT
// A chain as a person writes it: named elements in sequence, blocks of parallel branches among them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "stiffmap/algebra/se3.hpp"
#include "stiffmap/model/law.hpp"
#include "stiffmap/model/spring.hpp"

namespace stiffmap {

/// Constant transform: `nominal` is what the controller believes, `actual` what was built.
struct Offset {
  std::string name;
  Pose nominal, actual;
};

enum class JointType : std::uint8_t { revolute, prismatic };

/// Error of a commanded coordinate u, theory (G1): offset + slope (u - reference)
/// + amplitude sin(2 pi (u - reference) / period + phase) + what `knots` say at u: (coordinate, error) by rising
/// coordinate, straight between them and level beyond the ends. u is that of the joint `of`; empty: the drive's own.
struct CommandError {
  std::string of;
  double offset = 0, slope = 0, amplitude = 0, period = 1, phase = 0, reference = 0;
  std::vector<std::pair<double, double>> knots;

  double operator()(double u) const;
};

/// Deviation of a guide across its stroke, theory (G3): a translation along `axis` of the carriage.
struct GuideError {
  Vec3 axis = Vec3::UnitY();
  CommandError error;
};

/// What the first of three rotations about one point says of them (theory C8).
enum class BallChart : std::uint8_t {
  none,   ///< no ball joint
  free,   ///< any three axes would do: no force, friction or limit refers to these
  meant,  ///< laws, friction or limits about these axes
};

/// Numbers of a drive, declared once: bindings, chains and mechanism hold them as they stand here.
struct DriveNumbers {
  double compliance_slope = 0;  ///< relative change of the drive's compliance per unit of travel from home
  double force_limit = 1e300;
  double sag = 0;  ///< of a drive that turns, rad per m by which the tip rises with it (theory G4)
};

/// Every one by its name, as Python gives it.
struct DriveNumber {
  const char* name;
  double DriveNumbers::* value;
};
inline constexpr DriveNumber drive_numbers[] = {
    {"compliance_slope", &DriveNumbers::compliance_slope},
    {"force_limit", &DriveNumbers::force_limit},
    {"sag", &DriveNumbers::sag},
};

/// One-axis joint. Actuated: `law` is the drive's compliance (none: rigid).
/// Passive: `law` acts about the home coordinate, or about the commanded one (none: free).
struct Joint {
  std::string name;
  JointType type = JointType::revolute;
  Vec3 axis = Vec3::UnitZ();
  bool actuated = false;
  double home = 0;
  std::optional<Law> law;
  DriveNumbers numbers;
  std::vector<CommandError> command_errors;
  std::vector<GuideError> guide_errors;
  double friction = 0;         ///< free passive joint: constant force against its deflection; < 0: with it (theory L3)
  bool about_command = false;  ///< passive: `law` acts about the commanded coordinate
  std::optional<double> rest;  ///< passive: coordinate at which `law` is free of force; none: as at home
  BallChart ball = BallChart::none;  ///< this joint and the next two are one ball joint
  double lower = -1e300, upper = 1e300;
};

/// Virtual spring of six coordinates (t, phi): p + R t, R Rx Ry Rz (theory S2). `laws` replace single
/// uncoupled directions; `rest` is the deflection without force; `stroke`: `matrix` is where it counts from.
struct Spring {
  std::string name;
  SpringMatrix matrix;
  Vec6 rest = Vec6::Zero();
  std::vector<std::pair<int, Law>> laws;
  std::optional<Stroke> stroke;
};

struct Body {
  std::string name;
  double mass = 0;
  Vec3 com = Vec3::Zero();
};

struct Point {
  std::string name;
  Vec3 offset = Vec3::Zero();
};

struct Chain;

/// Two or more branches between the same two frames.
struct Block {
  std::string name;
  std::vector<std::pair<std::string, Chain>> branches;
};

struct Chain {
  std::vector<std::variant<Offset, Joint, Spring, Body, Point, Block>> elements;
};

/// What makes a straight spring a cable: its free length is the command of a winch (theory B1-B4).
struct Winch {
  double elasticity = 0;   ///< axial stiffness EA, N; 0: the spring's own stiffness alone
  double lead = 0;         ///< cable between winch and anchor, m: it yields, and counts in no length
  double pretension = 0;   ///< that the controller believes in: lengths are commanded shorter by its elongation
  double factor = 1;       ///< of the real cable's stiffness on the one that is believed in
  double lead_factor = 1;  ///< tension of the lead by that of the free length (friction of the guide)
  double radius = 0;       ///< of the pulley that turns about `axis` through the anchor; 0: an eye
  Vec3 axis = Vec3::UnitZ();
  Vec3 anchor_error = Vec3::Zero();  ///< real anchor minus the one that is believed in
  Vec3 point_error = Vec3::Zero();   ///< the same of the point, in the axes of its body
  double lower = -1e300, upper = 1e300;
  DriveNumbers numbers;
  std::vector<CommandError> errors;
};

/// A straight spring from a point of the machine to a fixed anchor (hose, counterbalance); with a winch: a cable.
struct ExternalSpring {
  std::string name, point;
  Vec3 anchor = Vec3::Zero();
  double stiffness = 0, length = 0;
  bool tension_only = false;
  std::optional<Winch> winch = std::nullopt;
};

}  // namespace stiffmap
