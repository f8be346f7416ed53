// SPDX-License-Identifier: MIT
// The immutable mechanism shared by all threads: the chains flattened to a tree of frames with one
// elementary coordinate each, and six closure equations per extra branch (theory C1-C3).
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stiffmap/model/chain.hpp"

namespace stiffmap {

enum class Role : std::uint8_t { actuator, passive, spring };

/// A frame: its parent's frame, a constant transform, then the motion of one coordinate (or none).
struct Node {
  Index parent = -1;
  Pose nominal, actual;
  Index coordinate = -1;
  JointType type = JointType::revolute;
  Vec3 axis = Vec3::UnitZ();
};

struct Coordinate {
  std::string name;
  Role role = Role::passive;
  Index node = -1;
  JointType type = JointType::revolute;
  double home = 0;
  double lower = -1e300, upper = 1e300;
  Index actuator = -1;  ///< index among the actuators
  Index law = -1;       ///< index into laws, -1: none
  Index ball = -1;      ///< index into balls of the joint that it is an axis of, -1: none
  bool locked = false;  ///< rigid drive, deviation of a guide, or a spin that changes nothing (held at home)
  double friction = 0;  ///< of a free passive joint
  bool about_command = false;
  std::optional<double> rest;  ///< as declared; none: as at home
  Index cable = -1;            ///< free length of this external spring: no frame moves with it

  /// The law of a passive joint acts about its home coordinate unless it says otherwise.
  bool from_home() const { return role == Role::passive && law >= 0 && !about_command; }
};

/// A ball joint of which the second axis is perpendicular to the others: its chart locks where the second
/// coordinate is a right angle from `middle` (theory C8).
struct Ball {
  Index first = 0;
  double middle = 0;
  bool free = true;

  /// 1 where the three axes are perpendicular, 0 where two coincide.
  double spread(double second) const { return std::abs(std::cos(second - middle)); }
};

/// A free ball joint that has other axes than it was declared with: one is the line about which a body spins.
struct SpunBall {
  Index first = 0;  ///< coordinate
  Mat3 turn;        ///< constant rotation before the joint: its own at home, where the coordinates are zero
  Mat3 axes;        ///< columns
};

inline constexpr double near_lock = 0.02;  ///< spread below which a pose carries a flag
inline constexpr double locked = 1e-5;     ///< spread below which a direction of rotation is lost

/// A coupled spring over coordinates first .. first+5.
struct SpringGroup {
  std::string name;
  Index first = 0;
  SpringMatrix matrix;
  Vec6 rest = Vec6::Zero();
  std::optional<Stroke> stroke;
  Index varies_with = -1;  ///< coordinate of the stroke
};

/// Error of the coordinate `of`, which moves `coordinate`: the drive's own, or one across its guide.
struct DriveError {
  Index coordinate = -1, of = -1;
  CommandError error;
};

struct Drive {
  std::string name;
  Index coordinate = -1;
  DriveNumbers numbers;
  std::vector<DriveError> errors;
};

/// Two frames that a closed loop makes one: `end` of an extra branch and `primary` of the first.
struct Loop {
  std::string block, branch;
  Index primary = -1, end = -1;
  bool leg = false;  ///< a loop of the outermost block: its multiplier is the leg's wrench
  std::string name;  ///< full name of the extra branch
};

struct NodePoint {
  std::string name;
  Index node = -1;
  Vec3 offset = Vec3::Zero();
};

struct NodeBody {
  std::string name;
  Index node = -1;
  double mass = 0;
  Vec3 com = Vec3::Zero();
};

struct NodeSpring {
  std::string name;
  Index node = -1;
  Vec3 offset = Vec3::Zero(), anchor = Vec3::Zero();
  double stiffness = 0, length = 0;
  bool tension_only = false;
  std::optional<Winch> winch = std::nullopt;
  Index coordinate = -1;  ///< of the winch: the free length
};

/// Which of the six pose components are commanded: translations along base axes, rotations about the
/// axes of the commanded TCP frame. The closure of the machine decides the others.
using Task = std::array<bool, 6>;
inline constexpr Task full_task{true, true, true, true, true, true};

struct HomeRecords;

/// The legs' block is the first block of `root` whose name is "legs".
class Mechanism {
 public:
  Mechanism(const Chain& root, const Pose& home, const std::vector<ExternalSpring>& springs = {});

  std::vector<Node> nodes;
  std::vector<Coordinate> coordinates;
  std::vector<SpringGroup> groups;
  std::vector<Ball> balls;
  std::vector<SpunBall> spun_balls;
  std::vector<Law> laws;
  std::vector<Drive> drives;
  std::vector<Loop> loops;
  std::vector<NodePoint> points;  ///< the first is "tcp"
  std::vector<NodeBody> bodies;
  std::vector<NodeSpring> external_springs;
  std::vector<Index> cables;             ///< those of them that have a winch
  std::vector<std::string> legs;         ///< names of the branches of the legs' block
  std::vector<bool> beyond_legs;         ///< per node: on the platform's side of the legs' block
  std::vector<std::vector<Index>> path;  ///< per node: its coordinates from the base outwards
  Task task = full_task;                 ///< commanded pose components
  Pose home;                             ///< tip pose of the home configuration
  VecX home_coordinates;                 ///< as declared; once assembled: closed at home
  VecX beside_home;                      ///< closed, where hinges that lock at home do not; empty: none do
  bool floating = false;                 ///< no leg and no spring: what carries the platform are external springs
  Index redundancy = 0;                  ///< motions of the drives that a commanded pose leaves open (theory C11)
  VecX nearness;                         ///< weights of the coordinates' distance, where some are
  VecX rest;                             ///< where laws about a fixed coordinate are free of force
  double length = 1;                     ///< characteristic length: turns angles into lengths in every norm
  double stiffness = 1;                  ///< characteristic stiffness, N/m: turns forces into lengths
  Index tip = -1;
  Chain description;                     ///< what it was made from
  std::shared_ptr<HomeRecords> records;  ///< once assembled: of all machines made like it

  Index size() const { return static_cast<Index>(coordinates.size()); }
  Index closures() const { return 6 * static_cast<Index>(loops.size()); }
  Index point(const std::string& name) const;  ///< throws with the names that exist
  void set_rest();                             ///< declared, else as at home: call it when home has closed

  /// Length that a unit of coordinate j stands for.
  double unit(Index j) const {
    return coordinates[static_cast<std::size_t>(j)].type == JointType::revolute ? length : 1.0;
  }

 private:
  Index add_node(Index parent, const Pose& nominal, const Pose& actual);
  Index add_coordinate(Index node, const std::string& name, Role role, JointType type, const Vec3& axis, double home);
  std::vector<std::pair<Index, BallChart>> charts;  ///< while it is built: first coordinates of ball joints
  std::string outside;  ///< while it is built: prefix of points before (base) and behind (platform) the legs
  Index add_chain(const Chain& chain, Index node, const std::string& prefix, bool outermost);
  Index add_block(const Block& block, Index node, const std::string& prefix, bool outermost);
  Index add_joint(const Joint& joint, Index node, const std::string& prefix);
  Index add_guide_errors(const Joint& joint, Index node, const std::string& name);
  Index add_spring(const Spring& spring, Index node, const std::string& prefix);
  Index joint_near(const std::string& joint, std::string scope) const;
  void find_joints();
  void finish(const std::vector<ExternalSpring>& springs);
  void add_cable(const ExternalSpring& spring);
  bool floats() const;
  void set_scales();
  double farthest_anchor() const;
  void find_balls();
};

}  // namespace stiffmap
