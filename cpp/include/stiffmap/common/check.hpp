// SPDX-License-Identifier: MIT
// Refuse bad input at the door, once, and name what was given.
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

namespace stiffmap {

/// Throws std::invalid_argument "name: expected ..., got ..." unless `ok`.
template <class Got>
void require(bool ok, const std::string& name, const std::string& expected, const Got& got) {
  if (ok) return;
  std::ostringstream text;
  text << name << ": expected " << expected << ", got " << got;
  throw std::invalid_argument(text.str());
}

}  // namespace stiffmap
