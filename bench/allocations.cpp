// SPDX-License-Identifier: MIT
#include "allocations.hpp"

#include <atomic>
#include <cstdlib>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers bring their own
namespace {
std::atomic<long> calls{0};
}

// Definitions in the executable come before those of the C library.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
__attribute__((visibility("default"))) void* malloc(std::size_t n) { return ++calls, __libc_malloc(n); }
__attribute__((visibility("default"))) void* calloc(std::size_t k, std::size_t n) {
  return ++calls, __libc_calloc(k, n);
}
__attribute__((visibility("default"))) void* realloc(void* p, std::size_t n) { return ++calls, __libc_realloc(p, n); }
__attribute__((visibility("default"))) void* aligned_alloc(std::size_t a, std::size_t n) {
  return ++calls, __libc_memalign(a, n);
}
}

long stiffmap::bench::allocations() { return calls; }
#else
long stiffmap::bench::allocations() { return -1; }
#endif
