// SPDX-License-Identifier: MIT
#include "dispatch.hpp"

#include <cstdlib>

#include "stiffmap/common/check.hpp"

extern "C" void stiffmap_kernel_base(stiffmap::KernelTable*);
#ifdef STIFFMAP_X86_LEVELS
extern "C" void stiffmap_kernel_v3(stiffmap::KernelTable*);
extern "C" void stiffmap_kernel_v3_pair(stiffmap::KernelTable*);
extern "C" void stiffmap_kernel_v4(stiffmap::KernelTable*);
#endif

namespace stiffmap {
namespace {

KernelTable table_of(void (*entry)(KernelTable*)) {
  KernelTable t{};
  entry(&t);
  require(t.layout == program_layout, "kernel library " + std::string(t.level), "the layout of this build", t.layout);
  return t;
}

struct Level {
  KernelTable wide, pair;
};

#ifdef STIFFMAP_X86_LEVELS
#if defined(__clang__) && (__clang_major__ < 18 || defined(__apple_build_version__))
// Older Clang knows no names of levels. Processors with these have what else belongs to the level.
bool has_v3() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
         __builtin_cpu_supports("bmi2");
}
bool has_v4() {
  return has_v3() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
#else
bool has_v3() { return __builtin_cpu_supports("x86-64-v3"); }
bool has_v4() { return __builtin_cpu_supports("x86-64-v4"); }
#endif
#endif

/// Usable levels, lowest first. A level is asked for its table only where the processor has it.
const std::vector<Level>& levels() {
  static const std::vector<Level> all = [] {
    const KernelTable base = table_of(&stiffmap_kernel_base);
    std::vector<Level> out{{base, base}};
#ifdef STIFFMAP_X86_LEVELS
    if (has_v3()) out.push_back({table_of(&stiffmap_kernel_v3), table_of(&stiffmap_kernel_v3_pair)});
    if (has_v4()) out.push_back({table_of(&stiffmap_kernel_v4), table_of(&stiffmap_kernel_v3_pair)});
#endif
    return out;
  }();
  return all;
}

const Level& chosen() {
  const char* wanted = std::getenv("STIFFMAP_ISA");
  if (!wanted || !*wanted) return levels().back();
  std::string known;
  for (const Level& l : levels()) {
    if (wanted == std::string(l.wide.level)) return l;
    known += (known.empty() ? "" : ", ") + std::string(l.wide.level);
  }
  require(false, "STIFFMAP_ISA", "a level of this processor (" + known + ")", wanted);
  return levels().back();
}

}  // namespace

std::vector<std::string> kernel_levels() {
  std::vector<std::string> out;
  for (const Level& l : levels()) out.emplace_back(l.wide.level);
  return out;
}

const KernelTable& kernel() { return chosen().wide; }

const KernelTable& kernel(std::int64_t count) {
  const Level& level = chosen();
  return count <= level.pair.lanes ? level.pair : level.wide;
}

}  // namespace stiffmap
