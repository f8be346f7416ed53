// SPDX-License-Identifier: MIT
// What assembly finds out about a home configuration. It depends on nominal geometry alone, so that machines that
// differ in springs, errors or bodies share it instead of finding it again: the same numbers to the last bit.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stiffmap/closure/home.hpp"
#include "stiffmap/common/parallel.hpp"

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

  std::vector<Closing> closings;  ///< in the order in which assembly closes
  std::vector<SpunBall> balls;    ///< renumbered
  std::vector<Index> locked;      ///< spins that are held
  VecX beside_home;               ///< as of Mechanism
  std::vector<Turned> turned;     ///< per held spin, until one is let go
};

/// The last few that were found out about machines made like each other, by their nominal geometry.
struct HomeRecords : RecentValues<std::shared_ptr<const HomeRecord>> {
  using RecentValues::RecentValues;
};

/// All that a record depends on, as bytes.
std::string nominal_geometry(const Chain& root, const Pose& home, const Task& commanded, HomeSearch how);

}  // namespace stiffmap
