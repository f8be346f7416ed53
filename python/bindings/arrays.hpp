// SPDX-License-Identifier: MIT
// NumPy arrays at the border: C order, float64, shapes checked by name.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "stiffmap/check.hpp"
#include "stiffmap/types.hpp"

namespace stiffmap::bindings {

namespace py = pybind11;
using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;  // a rotation as numpy keeps it
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;

inline std::string shape_text(const py::array& a) {
  std::string out = "(";
  for (py::ssize_t i = 0; i < a.ndim(); ++i) out += (i ? ", " : "") + std::to_string(a.shape(i));
  return out + ")";
}

/// Data of an array whose shape must be exactly `shape`.
inline const double* data(const Array& a, const std::vector<py::ssize_t>& shape, const std::string& name) {
  bool same = a.ndim() == static_cast<py::ssize_t>(shape.size());
  std::string wanted = "shape (";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    same = same && a.shape(static_cast<py::ssize_t>(i)) == shape[i];
    wanted += (i ? ", " : "") + std::to_string(shape[i]);
  }
  require(same, name, wanted + ")", shape_text(a));
  return a.data();
}

}  // namespace stiffmap::bindings
