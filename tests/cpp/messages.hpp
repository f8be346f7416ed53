// SPDX-License-Identifier: MIT
// What a refusal says.
#pragma once

#include <stdexcept>
#include <string>

namespace stiffmap::test {

/// Message of the exception that `f` throws.
template <class F>
std::string message(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing thrown";
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace stiffmap::test
