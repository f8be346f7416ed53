// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace stiffmap::bench {

/// The command line; see usage() in options.cpp.
struct Options {
  std::string command = "map", machine = "orthoglide", method = "fast";
  int grid = 20, threads = 1, repeat = 9;
  double force = 300;
  bool json = false, help = false;
};

/// Throws std::invalid_argument that says what was expected.
Options parse(int argc, char** argv);

const char* usage();

}  // namespace stiffmap::bench
