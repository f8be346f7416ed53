// SPDX-License-Identifier: MIT
// Questions to a machine at many poses: arrays in, arrays by name out. Nothing of Python is touched on the way.
#include "arrays.hpp"
#include "stiffmap/kinematics/enclosure.hpp"
#include "stiffmap/machining/chatter.hpp"
#include "stiffmap/solve/poses.hpp"

namespace stiffmap::bindings {

void bind_poses(py::module_& m) {
  using namespace py::literals;
  const py::call_guard<py::gil_scoped_release> free;
  py::class_<Mechanism>(m.attr("Mechanism"))
      .def_property_readonly("not_enclosed", &Encloser::missing)
      .def("closure", &closures, free, "plan"_a.none(true), "given"_a, "rotation"_a, "start"_a, "threads"_a)
      .def("kinematics", &kinematics, free, "position"_a, "rotation"_a, "start"_a, "weights"_a, "patient"_a, "only"_a,
           "threads"_a)
      .def("enclose", &enclosures, free, "centre"_a, "half"_a, "axes"_a, "rotation"_a, "start"_a, "slopes"_a,
           "watched"_a, "threads"_a)
      .def("dynamics", &dynamics, free, "inertias"_a, "coordinates"_a, "twist"_a, "twist_rate"_a, "wrench"_a,
           "gravity"_a, "rates"_a, "accelerations"_a, "weights"_a, "threads"_a)
      .def("modes", &modes, free, "inertias"_a, "viscous"_a, "loss"_a, "position"_a, "rotation"_a, "wrench"_a,
           "gravity"_a, "closed"_a, "point"_a, "count"_a, "whole"_a, "threads"_a)
      .def("clamp", &clamps, free, "position"_a, "rotation"_a, "displacement"_a, "point"_a, "gravity"_a, "threads"_a)
      .def("reactions", &reactions, free, "position"_a, "rotation"_a, "wrench"_a, "point"_a, "gravity"_a, "threads"_a)
      .def("frames", &node_frames, free, "coordinates"_a)
      .def("point_positions", &point_positions, free, "point"_a, "coordinates"_a);
  m.def(
      "multipliers",
      [](const VecX& frequency, const VecX& ratio, const VecX& mass, const Eigen::MatrixX3d& way, const Mat3& rest,
         const std::vector<Chip>& chips, const VecX& period, const VecX& depth, int threads) {
        return largest_multipliers({frequency, ratio, mass, way.transpose(), rest}, chips, period, depth, threads);
      },
      free, "frequency"_a, "ratio"_a, "mass"_a, "way"_a, "rest"_a, "chips"_a, "period"_a, "depth"_a, "threads"_a);
}

}  // namespace stiffmap::bindings
