// SPDX-License-Identifier: MIT
#include "dispatch.hpp"

#include <array>
#include <cstdlib>

#include "stiffmap/check.hpp"

extern "C" void stiffmap_kernel_base(stiffmap::KernelTable*);
#ifdef STIFFMAP_X86_LEVELS
extern "C" void stiffmap_kernel_v3(stiffmap::KernelTable*);
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

/// Usable tables, lowest level first. Filling a table runs no vector code.
const std::vector<KernelTable>& tables() {
  static const std::vector<KernelTable> all = [] {
    std::vector<KernelTable> out{table_of(&stiffmap_kernel_base)};
#ifdef STIFFMAP_X86_LEVELS
    if (__builtin_cpu_supports("x86-64-v3")) out.push_back(table_of(&stiffmap_kernel_v3));
    if (__builtin_cpu_supports("x86-64-v4")) out.push_back(table_of(&stiffmap_kernel_v4));
#endif
    return out;
  }();
  return all;
}

}  // namespace

std::vector<std::string> kernel_levels() {
  std::vector<std::string> out;
  for (const KernelTable& t : tables()) out.emplace_back(t.level);
  return out;
}

const KernelTable& kernel() {
  const char* wanted = std::getenv("STIFFMAP_ISA");
  if (!wanted || !*wanted) return tables().back();
  std::string known;
  for (const KernelTable& t : tables()) {
    if (wanted == std::string(t.level)) return t;
    known += (known.empty() ? "" : ", ") + std::string(t.level);
  }
  require(false, "STIFFMAP_ISA", "a level of this processor (" + known + ")", wanted);
  return tables().back();
}

}  // namespace stiffmap
