// SPDX-License-Identifier: MIT
// Coordinates and their slopes enclosed over a whole cell of positions, springs at rest (theory D8).
#pragma once

#include <array>
#include <string>

#include "stiffmap/kinematics/motion.hpp"

namespace stiffmap {

/// What holds at every position centre + axes * d with |d_k| <= half_k; nothing if not `enclosed`.
/// Slopes G: coordinates per twist of the tip, the first three columns along `axes`.
struct Enclosure {
  bool enclosed = false;
  MatX G;                      ///< coordinates x 3 or 6, at the centre
  VecX radius;                 ///< |x - x_centre - G d|
  std::array<MatX, 3> change;  ///< dG / d d_k, at the centre
  MatX slack;                  ///< |G - G_centre - sum change_k d_k|
  VecX moved;                  ///< m, of the frames asked for
  Vec3 bend;                   ///< share of each axis in the curvature, also where nothing is enclosed; NaN: unknown
};

/// Existence and uniqueness by Krawczyk's operator about the tangent motion; what is left over is bounded by how
/// far joints turn and move each other. Radii carry a cushion for round-off, which is not directed.
class Encloser {
 public:
  explicit Encloser(const Mechanism& m);

  /// Empty where cells of this machine can be enclosed, else why not.
  static std::string missing(const Mechanism& m);

  /// At closed coordinates of the cell's centre and their frames; columns of `axes` are unit vectors. `slopes`:
  /// 3 (translations) or 6 columns of G.
  void enclose(const Mechanism& m, const Frames& frames, const VecX& x, const Mat3& axes, const Vec3& half,
               Index slopes, const std::vector<Index>& watched, Enclosure& out);

 private:
  /// Joints that move a frame relative to another, from the base outwards.
  struct Arm {
    std::vector<Index> joint;  ///< coordinates
    std::vector<Index> unknown;
    Mat3X w, c;        ///< axis, and velocity that it gives to the end
    VecX size;         ///< |c| at most
    VecX turn, lever;  ///< bounds: turn of the axis, change of c in the axis's own frame
    double whole = 0;  ///< turn of the end
  };
  /// Equations' derivatives along three directions and their radii, angles as lengths.
  struct Bend {
    std::array<MatX, 3> at, radius;
  };

  class Majorant {
   public:
    bool compute(const MatX& E);
    MatX solve(const MatX& b) const {
      MatX x;
      lu_.solve(b, x);
      return x;
    }

   private:
    Lu lu_;
  };

  void build(const Mechanism& m, const Frames& frames, Index end, Arm& arm) const;
  void bound(const Mechanism& m, const VecX& swing, Arm& arm) const;
  void columns(const Mechanism& m, const Arm& arm, double sign, Index row, double extra, MatX& at, MatX& radius) const;
  void second(const Mechanism& m, const Arm& arm, double sign, Index row, const MatX& slope, const MatX& slack,
              bool centre, Bend& bend) const;
  void scale(const Mechanism& m, MatX& rows) const;
  template <class Each>
  void each(Each&& f);
  bool exists(const Mechanism& m, const Vec3& half);
  bool widen(const Mechanism& m, const Vec3& half, const VecX& step, const VecX& rest, VecX& image);

  Arm tip_;
  std::vector<std::array<Arm, 2>> loops_;
  std::vector<Index> unknown_;
  Majorant majorant_;
  MatX A_, C_, absC_, change_, bent_, E_, G_, dG_, defect_, lost_;
  std::array<MatX, 3> P_;
  VecX q_, rest_;
  Bend bend_;
};

}  // namespace stiffmap
