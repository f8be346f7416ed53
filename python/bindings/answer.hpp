// SPDX-License-Identifier: MIT
// Answer of a call on many poses: NumPy arrays that the core writes into.
#pragma once

#include "arrays.hpp"
#include "stiffmap/batch.hpp"

namespace stiffmap::bindings {

using Shape = std::vector<py::ssize_t>;

/// Arrays of one call; every array has the pose as its leading axis.
struct Answer {
  Answer(const Mechanism& m, py::ssize_t n, py::ssize_t reads, py::ssize_t moved, bool full)
      : displacement(Shape{n, reads, 6}), status(n), flags(n), iterations(n) {
    const py::ssize_t legs = static_cast<py::ssize_t>(m.legs.size()), k = full ? n : 0;
    for (py::array_t<double>* a : {&stiffness, &compliance, &free_twists}) *a = py::array_t<double>(Shape{k, 6, 6});
    effort = py::array_t<double>(Shape{k, static_cast<py::ssize_t>(m.drives.size())});
    leg_wrench = py::array_t<double>(Shape{k, legs, 6});
    coordinates = py::array_t<double>(Shape{k, m.size()});
    indeterminate = py::array_t<std::uint8_t>(Shape{k, m.size()});
    variants = py::array_t<double>(Shape{moved ? n : 0, moved, 6});
    out.displacement = displacement.mutable_data();
    out.status = status.mutable_data();
    out.flags = flags.mutable_data();
    out.iterations = iterations.mutable_data();
    if (moved) out.variants = variants.mutable_data();
    if (!full) return;
    out.stiffness = stiffness.mutable_data();
    out.compliance = compliance.mutable_data();
    out.free_twists = free_twists.mutable_data();
    out.effort = effort.mutable_data();
    out.leg_wrench = leg_wrench.mutable_data();
    out.coordinates = coordinates.mutable_data();
    out.indeterminate = indeterminate.mutable_data();
  }

  py::array_t<double> displacement, stiffness, compliance, free_twists, effort, leg_wrench, coordinates, variants;
  py::array_t<std::uint8_t> indeterminate, status;
  py::array_t<std::uint32_t> flags;
  py::array_t<std::int32_t> iterations;
  BatchOutput out;
};

}  // namespace stiffmap::bindings
