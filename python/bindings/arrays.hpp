// SPDX-License-Identifier: MIT
// NumPy arrays at the border: C order, float64, shapes checked by name; and the answers of the core as a dict of
// arrays.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "stiffmap/common/answers.hpp"
#include "stiffmap/common/check.hpp"

namespace stiffmap::bindings {

namespace py = pybind11;
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Shape = std::vector<py::ssize_t>;

inline std::string shape_text(const py::array& a) {
  std::string out = "(";
  for (py::ssize_t i = 0; i < a.ndim(); ++i) out += (i ? ", " : "") + std::to_string(a.shape(i));
  return out + ")";
}

/// Data of an array whose shape must be exactly `shape`.
inline const double* data(const Array& a, const Shape& shape, const std::string& name) {
  bool same = a.ndim() == static_cast<py::ssize_t>(shape.size());
  std::string wanted = "shape (";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    same = same && a.shape(static_cast<py::ssize_t>(i)) == shape[i];
    wanted += (i ? ", " : "") + std::to_string(shape[i]);
  }
  require(same, name, wanted + ")", shape_text(a));
  return a.data();
}

inline py::ssize_t count_of(const Array& a) { return a.ndim() ? a.shape(0) : 0; }

/// One row for each pose, of `shape`, poses first.
inline Rows rows(const Array& a, const Shape& shape, const std::string& name) {
  Index width = 1;
  for (std::size_t i = 1; i < shape.size(); ++i) width *= shape[i];
  return {data(a, shape, name), shape[0], width};
}

/// The same, or no rows where the array has none.
inline Rows rows_or_none(const Array& a, const Shape& shape, const std::string& name) {
  return count_of(a) ? rows(a, shape, name) : Rows(nullptr, 0, 0);
}

inline Vec3 vec3(const Array& a, const char* name) { return Eigen::Map<const Vec3>(data(a, {3}, name)); }
inline Mat3 mat3(const Array& a, const char* name) { return Eigen::Map<const Row3>(data(a, {3, 3}, name)); }
inline VecX vector(const Array& a, py::ssize_t size, const char* name) {
  return Eigen::Map<const VecX>(data(a, {size}, name), size);
}

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
