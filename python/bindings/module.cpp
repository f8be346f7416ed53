// SPDX-License-Identifier: MIT
#include <pybind11/pybind11.h>

namespace stiffmap::bindings {
void bind_chain(pybind11::module_& m);
void bind_mechanism(pybind11::module_& m);
void bind_one(pybind11::module_& m);
void bind_paths(pybind11::module_& m);
void bind_poses(pybind11::module_& m);
void bind_solve(pybind11::module_& m);
}  // namespace stiffmap::bindings

PYBIND11_MODULE(_core, m, pybind11::mod_gil_not_used()) {
  m.doc() = "Compiled core of stiffmap; use the functions of the stiffmap package instead.";
  stiffmap::bindings::bind_chain(m);
  stiffmap::bindings::bind_mechanism(m);  // before what takes a Mechanism
  stiffmap::bindings::bind_solve(m);
  stiffmap::bindings::bind_one(m);
  stiffmap::bindings::bind_paths(m);
  stiffmap::bindings::bind_poses(m);
}
