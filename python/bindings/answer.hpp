// SPDX-License-Identifier: MIT
// Answer of a call on many poses: NumPy arrays that the core writes into.
#pragma once

#include <algorithm>
#include <limits>
#include <utility>

#include "arrays.hpp"
#include "stiffmap/common/kept_memory.hpp"
#include "stiffmap/solve/batch.hpp"

namespace stiffmap::bindings {

/// A new array, not filled, of memory that is kept.
template <class T>
py::array_t<T> kept_array(const Shape& shape) {
  std::size_t bytes = sizeof(T);
  for (const py::ssize_t n : shape) bytes *= static_cast<std::size_t>(n);
  if (!KeptMemory::keeps(bytes)) return py::array_t<T>(shape);
  auto* const piece = KeptMemory::all().take(bytes);
  const py::capsule owner(piece, [](void* p) { KeptMemory::all().give(static_cast<KeptMemory::Piece*>(p)); });
  return py::array_t<T>(shape, static_cast<T*>(piece->memory), owner);
}

/// Arrays of one call; every array has the pose as its leading axis.
struct Answer {
  Answer(const Mechanism& m, py::ssize_t n, py::ssize_t reads, py::ssize_t moved, bool full)
      : displacement(kept_array<double>({n, reads, 6})), status(n), flags(n), iterations(n) {
    const py::ssize_t legs = static_cast<py::ssize_t>(m.legs.size()), k = full ? n : 0;
    for (py::array_t<double>* a : {&stiffness, &compliance, &free_twists}) *a = kept_array<double>({k, 6, 6});
    effort = kept_array<double>({k, static_cast<py::ssize_t>(m.drives.size())});
    leg_wrench = kept_array<double>({k, legs, 6});
    coordinates = kept_array<double>({k, m.size()});
    indeterminate = kept_array<std::uint8_t>({k, m.size()});
    nothing_free = kept_array<std::uint8_t>({k});
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
    out.nothing_free = nothing_free.mutable_data();
    std::fill_n(out.nothing_free, k, std::uint8_t{0});
    out.effort = effort.mutable_data();
    out.leg_wrench = leg_wrench.mutable_data();
    out.coordinates = coordinates.mutable_data();
    out.indeterminate = indeterminate.mutable_data();
  }

  /// NaN where there are none: written when they are asked for.
  const py::array_t<double>& twists() {
    for (py::ssize_t i = 0; i < nothing_free.size(); ++i)
      if (std::exchange(out.nothing_free[i], 0))
        std::fill_n(out.free_twists + 36 * i, 36, std::numeric_limits<double>::quiet_NaN());
    return free_twists;
  }

  py::array_t<double> displacement, stiffness, compliance, effort, leg_wrench, coordinates, variants;
  py::array_t<std::uint8_t> indeterminate, status;
  py::array_t<std::uint32_t> flags;
  py::array_t<std::int32_t> iterations;
  BatchOutput out;

 private:
  py::array_t<double> free_twists;
  py::array_t<std::uint8_t> nothing_free;
};

}  // namespace stiffmap::bindings
