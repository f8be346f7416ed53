// SPDX-License-Identifier: MIT
// What assembly finds out about a home configuration. It depends on nominal geometry alone, so that a machine that
// differs in springs, errors or bodies takes it over instead of finding it again: the same numbers to the last bit.
#pragma once

#include <vector>

#include "stiffmap/home.hpp"

namespace stiffmap {

struct HomeRecord {
  struct Closing {
    VecX coordinates;
    Pose home;
  };

  /// Where a held spin has turned.
  struct Turned {
    VecX coordinates;      ///< closed; empty: it does not close there
    bool settled = false;  ///< the tip's stiffness stays there as it is at home, whatever springs and laws are
  };

  Chain declared;
  Pose home;
  Task task = full_task;
  HomeSearch search = HomeSearch::near;
  std::vector<Closing> closings;  ///< in the order in which assembly closes
  std::vector<SpunBall> balls;    ///< renumbered
  std::vector<Index> locked;      ///< spins that are held
  VecX beside_home;               ///< as of Mechanism
  std::vector<Turned> turned;     ///< per held spin, until one is let go

  /// Whether the same would be found out about this chain.
  bool holds_for(const Chain& root, const Pose& home_pose, const Task& commanded, HomeSearch how) const;
};

}  // namespace stiffmap
