// SPDX-License-Identifier: MIT
// The only clock of the C++ code, and what is said of repeated measurements.
#pragma once

#include <algorithm>
#include <chrono>
#include <vector>

namespace stiffmap::bench {

/// Seconds that `work` takes.
template <class Work>
double seconds(Work&& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Summary {
  double median, min, max;
};

inline Summary summary(std::vector<double> values, double factor = 1) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  const double median = n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  return {factor * median, factor * values.front(), factor * values.back()};
}

/// Keeps a result from being optimised away.
template <class T>
void keep(const T& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

}  // namespace stiffmap::bench
