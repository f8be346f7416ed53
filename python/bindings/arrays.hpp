// SPDX-License-Identifier: MIT
// NumPy arrays at the border: rows of numbers for the core, C order, float64; and its answers as a dict of arrays.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <optional>
#include <vector>

#include "stiffmap/common/answers.hpp"

namespace stiffmap::bindings {

namespace py = pybind11;
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Shape = std::vector<py::ssize_t>;

/// What NumPy calls a value of the core.
template <class T>
struct Plain {
  using Type = T;
};
template <>
struct Plain<Status> {
  using Type = std::uint8_t;
};
template <>
struct Plain<std::uint8_t> {
  using Type = bool;
};

}  // namespace stiffmap::bindings

namespace pybind11::detail {

/// Whatever the shape behind the poses; None: no rows. The array lives as long as the call.
template <>
struct type_caster<stiffmap::Rows> {
  static constexpr auto name = type_caster<stiffmap::bindings::Array>::name + const_name(" | None");
  template <class>
  using cast_op_type = const stiffmap::Rows&;

  operator const stiffmap::Rows&() const { return *rows_; }

  bool load(handle given, bool) {
    if (given.is_none()) return rows_.emplace(nullptr, 0, 0), true;
    array_ = stiffmap::bindings::Array::ensure(given);
    if (!array_ || array_.ndim() == 0) return false;
    stiffmap::Index width = 1;
    for (ssize_t i = 1; i < array_.ndim(); ++i) width *= array_.shape(i);
    rows_.emplace(array_.data(), array_.shape(0), width);
    return true;
  }

 private:
  stiffmap::bindings::Array array_;
  std::optional<stiffmap::Rows> rows_;
};

/// Each array keeps its own memory, which it takes over.
template <>
struct type_caster<stiffmap::Answers> {
  static constexpr auto name = const_name("dict[str, typing.Any]");

  static handle cast(stiffmap::Answers&& answers, return_value_policy, handle) {
    dict out;
    for (auto& a : answers.all())
      out[a.name.c_str()] = std::visit([&a](auto& values) -> object { return array_of(a.shape, values); }, a.values);
    return out.release();
  }

 private:
  template <class T>
  static object array_of(const std::vector<stiffmap::Index>& shape, std::vector<T>& values) {
    using Type = typename stiffmap::bindings::Plain<T>::Type;
    static_assert(sizeof(T) == sizeof(Type));
    auto* const kept = new std::vector<T>(std::move(values));
    const capsule owner(kept, [](void* p) { delete static_cast<std::vector<T>*>(p); });
    return array_t<Type>(shape, reinterpret_cast<const Type*>(kept->data()), owner);
  }
};

}  // namespace pybind11::detail
