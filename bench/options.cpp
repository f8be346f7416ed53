// SPDX-License-Identifier: MIT
#include "options.hpp"

#include <stdexcept>

namespace stiffmap::bench {
namespace {

double number(const std::string& name, const std::string& text, double low, double high) {
  std::size_t used = 0;
  double value = 0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
  }
  if (used == 0 || used != text.size() || !(value >= low && value <= high))
    throw std::invalid_argument(name + ": expected a number from " + std::to_string(low) + " to " +
                                std::to_string(high) + ", got '" + text + "'");
  return value;
}

int whole(const std::string& name, const std::string& text, int low, int high) {
  return static_cast<int>(number(name, text, low, high));
}

void set(Options& o, const std::string& name, const std::string& value) {
  if (name == "--machine") o.machine = value;
  else if (name == "--method") o.method = value;
  else if (name == "--grid") o.grid = whole(name, value, 1, 400);
  else if (name == "--threads") o.threads = whole(name, value, 1, 1024);
  else if (name == "--repeat") o.repeat = whole(name, value, 1, 10000);
  else if (name == "--force") o.force = number(name, value, -1e9, 1e9);
  else throw std::invalid_argument("unknown option " + name + "\n" + usage());
}

}  // namespace

Options parse(int argc, char** argv) {
  Options o;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--json") o.json = true;
    else if (word == "--help") o.help = true;
    else if (word.rfind("--", 0) != 0) o.command = word;
    else if (i + 1 < argc) set(o, word, argv[++i]);
    else throw std::invalid_argument(word + ": expected a value");
  }
  if (o.method != "fast" && o.method != "reference")
    throw std::invalid_argument("--method: expected fast or reference, got " + o.method);
  return o;
}

const char* usage() {
  return "usage: stiffmap_bench [command] [options]\n"
         "commands\n"
         "  map      poses of a grid: rate, time, iterations, allocations (default)\n"
         "  compare  fast path, reference path, one scalar 6x6 congruence + inverse, interleaved\n"
         "  scaling  two threads against one, interleaved pairs\n"
         "  serial   one leg of 4 to 256 springs: exponent of the cost\n"
         "  passes   where the time of a block of poses goes, per instruction-set level\n"
         "  peak     multiply-add rate of this core, per instruction-set level\n"
         "options\n"
         "  --machine tripteron|orthoglide   --grid N (N^3 poses)      --force N (along z, newton)\n"
         "  --threads N                      --method fast|reference   --repeat N\n"
         "  --json                           --help\n"
         "STIFFMAP_ISA=base|v3|v4 chooses the kernels.\n";
}

}  // namespace stiffmap::bench
