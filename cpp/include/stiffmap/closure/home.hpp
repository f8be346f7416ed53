// SPDX-License-Identifier: MIT
// The home configuration: declared coordinates are closed, and what is missing is told leg by leg (theory C9).
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "stiffmap/closure/closure.hpp"

namespace stiffmap {

/// How far the TCP as a leg carries it is from the home pose, or a branch's end from the first branch.
struct Gap {
  std::string name;                      ///< full name of the leg or branch
  double translation = 0, rotation = 0;  ///< m, rad
};

enum class HomeSearch : std::uint8_t {
  near,      ///< declared coordinates close within 5 % of the machine's size
  anywhere,  ///< they are a first guess
};

struct HomeFit {
  bool closed = false;
  std::vector<Gap> declared;  ///< at the declared coordinates
  std::vector<Gap> closest;   ///< at the coordinates that close best
};

/// A home configuration that does not close.
class HomeMisfit : public std::invalid_argument {
 public:
  explicit HomeMisfit(const HomeFit& of);
  HomeFit fit;
};

/// Closes the mechanism at home in the sense of least squares, starting from the declared coordinates.
/// What the task does not command follows: `m.home` is then the pose that is reached.
HomeFit close_home(Mechanism& m, HomeSearch search);

/// Is the closure error at the home coordinates round-off?
bool closes_exactly(const Mechanism& m);

/// The chain with a small constant transform at each end that `m`, closed at home, does not bring together
/// exactly: a file of few digits describes a machine that closes.
Chain corrected(const Mechanism& m);

}  // namespace stiffmap
