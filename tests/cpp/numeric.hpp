// SPDX-License-Identifier: MIT
// Central differences with their observed order, and repeatable random vectors.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>

namespace stiffmap::test {

/// Largest error of a central difference at step h, and the order observed between h and h/2.
struct Observed {
  double error, order;
};

/// `value(h)`: function on the line; `derivative`: what is claimed of it at h = 0.
template <class Value, class Derivative>
Observed central_difference(Value&& value, const Derivative& derivative, double h) {
  const auto error = [&](double step) {
    return ((value(step) - value(-step)) / (2 * step) - derivative).cwiseAbs().maxCoeff();
  };
  const double coarse = error(h), fine = error(h / 2);
  return {fine, std::log2(coarse / fine)};
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  template <int N>
  Eigen::Matrix<double, N, 1> vector(double size = 1) {
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) v[i] = uniform(-size, size);
    return v;
  }
  Eigen::VectorXd vector(Eigen::Index n, double size) {
    Eigen::VectorXd v(n);
    for (Eigen::Index i = 0; i < n; ++i) v[i] = uniform(-size, size);
    return v;
  }

 private:
  std::mt19937 engine_;
};

}  // namespace stiffmap::test
