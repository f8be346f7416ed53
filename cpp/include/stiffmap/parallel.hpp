// SPDX-License-Identifier: MIT
// The only header that knows threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace stiffmap {

/// Calls work(thread, begin, end) for fixed chunks of 0..count on up to `threads` threads. Chunks do
/// not depend on the number of threads, so neither do the results.
template <class Work>
void parallel_chunks(long count, long chunk, int threads, Work&& work) {
  const long chunks = (count + chunk - 1) / chunk;
  const int used = static_cast<int>(std::max<long>(1, std::min<long>(threads, chunks)));
  std::atomic<long> next{0};
  std::exception_ptr error;
  std::mutex guard;
  const auto run = [&](int thread) {
    try {
      for (long c = next++; c < chunks; c = next++) work(thread, c * chunk, std::min(count, (c + 1) * chunk));
    } catch (...) {
      const std::lock_guard<std::mutex> lock(guard);
      if (!error) error = std::current_exception();
      next = chunks;
    }
  };
  std::vector<std::jthread> pool;
  for (int t = 1; t < used; ++t) pool.emplace_back(run, t);
  run(0);
  pool.clear();
  if (error) std::rethrow_exception(error);
}

}  // namespace stiffmap
