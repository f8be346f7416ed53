// SPDX-License-Identifier: MIT
// The only header that knows threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <list>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
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

/// The last few values made, shared by all threads; `make` runs without the lock.
template <class Value>
class RecentValues {
 public:
  explicit RecentValues(std::size_t most) : most_(most) {}

  template <class Make>
  Value get(const std::string& key, Make&& make) {
    {
      const std::lock_guard<std::mutex> lock(guard_);
      for (auto it = values_.begin(); it != values_.end(); ++it)
        if (it->first == key) {
          values_.splice(values_.begin(), values_, it);
          return values_.front().second;
        }
    }
    Value made = make();
    const std::lock_guard<std::mutex> lock(guard_);
    values_.emplace_front(key, made);
    if (values_.size() > most_) values_.pop_back();
    return made;
  }

 private:
  std::size_t most_;
  std::mutex guard_;
  std::list<std::pair<std::string, Value>> values_;
};

}  // namespace stiffmap
