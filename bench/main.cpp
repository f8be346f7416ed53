// SPDX-License-Identifier: MIT
#include <cstdio>
#include <exception>
#include <map>
#include <stdexcept>

#include "commands.hpp"

using namespace stiffmap::bench;

int main(int argc, char** argv) {
  const std::map<std::string, Report (*)(const Options&)> commands{
      {"map", stiffmap::bench::map}, {"compare", compare}, {"scaling", scaling},
      {"serial", serial_leg},        {"passes", passes},   {"peak", peak}};
  try {
    const Options options = parse(argc, argv);
    const auto command = commands.find(options.command);
    if (options.help) return std::fputs(usage(), stdout), 0;
    if (command == commands.end()) throw std::invalid_argument("unknown command " + options.command + "\n" + usage());
    command->second(options).print(options.json);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "stiffmap_bench: %s\n", e.what());
    return 2;
  }
}
