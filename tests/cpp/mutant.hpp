// SPDX-License-Identifier: MIT
// Mutants that are chosen at run time by STIFFMAP_MUTANT (tests/python/project/mutation): included in front of every
// source of a copy of the core, never by the core itself.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <type_traits>

namespace mutant {

inline const int chosen = std::getenv("STIFFMAP_MUTANT") ? std::atoi(std::getenv("STIFFMAP_MUTANT")) : 0;
inline bool is(int n) { return n == chosen; }

/// A factor: one, or `other` where mutant n is chosen. A number keeps its type.
struct Factor {
  int n;
  double usual, other;
  double value() const { return is(n) ? other : usual; }
};
inline Factor sign(int n) { return {n, 1, -1}; }
inline Factor drop(int n) { return {n, 1, 0}; }
inline Factor minus(int n) { return {n, -1, 1}; }
inline Factor twice(int n) { return {n, 1, 2}; }

template <class T>
auto operator*(Factor f, const T& x) {
  if constexpr (std::is_arithmetic_v<T>) return static_cast<T>(static_cast<T>(f.value()) * x);
  else return f.value() * x;
}
template <class T>
auto operator*(const T& x, Factor f) {
  return f * x;
}
template <class T>
auto operator/(const T& x, Factor f) {
  if constexpr (std::is_arithmetic_v<T>) return static_cast<T>(x / static_cast<T>(f.value()));
  else return x / f.value();
}

/// `a < b` written as `a < Compare{n} < b`.
struct Compare {
  int n;
};
template <class A>
struct Compared {
  const A& a;
  int n;
};
#define STIFFMAP_COMPARE(op, negated)                   \
  template <class A>                                    \
  Compared<A> operator op(const A& a, Compare c) {      \
    return {a, c.n};                                    \
  }                                                     \
  template <class A, class B>                           \
  auto operator op(Compared<A> half, const B& b) {      \
    return is(half.n) ? half.a negated b : half.a op b; \
  }
STIFFMAP_COMPARE(<, >=)
STIFFMAP_COMPARE(>, <=)
STIFFMAP_COMPARE(<=, >)
STIFFMAP_COMPARE(>=, <)
STIFFMAP_COMPARE(==, !=)
STIFFMAP_COMPARE(!=, ==)
#undef STIFFMAP_COMPARE

inline double number(int n, double usual, double other) { return is(n) ? other : usual; }
struct Number {
  int n;
  double usual, other;
  operator double() const { return number(n, usual, other); }
};

template <int n, class T>
T minimum(const T& a, const T& b) {
  return is(n) ? std::max(a, b) : std::min(a, b);
}
template <int n, class T>
T maximum(const T& a, const T& b) {
  return is(n) ? std::min(a, b) : std::max(a, b);
}
template <int n>
double sine(double x) {
  return is(n) ? std::cos(x) : std::sin(x);
}
template <int n>
double cosine(double x) {
  return is(n) ? std::sin(x) : std::cos(x);
}

/// The first unless mutant n is chosen.
template <class T>
T& either(int n, T& usual, T& other) {
  return is(n) ? other : usual;
}

}  // namespace mutant
