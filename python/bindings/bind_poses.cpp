// SPDX-License-Identifier: MIT
// Questions to a machine at many poses: arrays in, arrays by name out. Nothing of Python is touched on the way.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "stiffmap/kinematics/enclosure.hpp"
#include "stiffmap/machining/chatter.hpp"
#include "stiffmap/solve/poses.hpp"

namespace stiffmap::bindings {
namespace {

py::ssize_t drives_of(const Mechanism& m) { return static_cast<py::ssize_t>(m.drives.size()); }

Inertias inertias_of(const Mechanism& m, const Array& values) {
  const Rows all = rows(values, {static_cast<py::ssize_t>(m.bodies.size()), 3, 3}, "inertias");
  Inertias out;
  for (Index k = 0; k < all.rows(); ++k) out.emplace_back(Eigen::Map<const Row3>(all.data() + 9 * k));
  return out;
}

/// Weights of the drives: one each, or none.
VecX weights_of(const Mechanism& m, const Array& values) {
  return count_of(values) ? vector(values, drives_of(m), "weights") : VecX();
}

LoadedPoses loaded(const Array& position, const Array& rotation, const Array& wrench, const Array& gravity) {
  const py::ssize_t n = count_of(position);
  return {rows(position, {n, 3}, "position"), rows(rotation, {n, 3, 3}, "rotation"), rows(wrench, {n, 6}, "wrench"),
          vec3(gravity, "gravity")};
}

Answers closure(const Mechanism& m, const FastPlan* plan, const Array& given, const Array& rotation, bool inverse,
                int threads, const std::optional<Array>& start) {
  const py::ssize_t n = count_of(given);
  return closures(m, plan, rows(given, {n, inverse ? 3 : drives_of(m)}, inverse ? "position" : "actuators"),
                  inverse ? rows(rotation, {n, 3, 3}, "rotation") : Rows(nullptr, 0, 0),
                  start ? rows(*start, {n, m.size()}, "start") : Rows(nullptr, 0, 0), threads);
}

Answers kinematics_of(const Mechanism& m, const Array& position, const Array& rotation, const Array& start,
                      const Array& weights, bool patient, bool only, int threads) {
  const py::ssize_t n = count_of(position);
  return kinematics(m, rows(position, {n, 3}, "position"), rows(rotation, {n, 3, 3}, "rotation"),
                    rows_or_none(start, {n, m.size()}, "start"), weights_of(m, weights), patient, only, threads);
}

Answers enclose(const Mechanism& m, const Array& centre, const Array& half, const Array& axes, const Array& rotation,
                const Array& start, int slopes, const std::vector<Index>& watched, int threads) {
  const py::ssize_t n = count_of(centre);
  return enclosures(m, rows(centre, {n, 3}, "centre"), rows(half, {n, 3}, "half"), mat3(axes, "axes"),
                    mat3(rotation, "rotation"), rows_or_none(start, {n, m.size()}, "start"), slopes, watched, threads);
}

Answers dynamics_of(const Mechanism& m, const Array& inertias, const Array& coordinates, const Array& twist,
                    const Array& twist_rate, const Array& wrench, const Array& gravity, const Array& rates,
                    const Array& accelerations, const Array& weights, int threads) {
  const py::ssize_t n = count_of(coordinates), drives = drives_of(m);
  return dynamics(m, inertias_of(m, inertias), rows(coordinates, {n, m.size()}, "coordinates"),
                  rows(twist, {n, 6}, "twist"), rows(twist_rate, {n, 6}, "twist_rate"), rows(wrench, {n, 6}, "wrench"),
                  vec3(gravity, "gravity"), rows_or_none(rates, {n, drives}, "rates"),
                  rows_or_none(accelerations, {n, drives}, "accelerations"), weights_of(m, weights), threads);
}

Answers modes_of(const Mechanism& m, const Array& inertias, const Array& viscous, const Array& loss,
                 const Array& position, const Array& rotation, const Array& wrench, const Array& gravity,
                 const Array& closed, const std::string& point, int count, bool whole, int threads) {
  return modes(m, inertias_of(m, inertias), {vector(viscous, m.size(), "viscous"), vector(loss, m.size(), "loss")},
               loaded(position, rotation, wrench, gravity),
               rows_or_none(closed, {count_of(position), m.size()}, "closed"), m.point(point), count, whole, threads);
}

Answers clamp(const Mechanism& m, const Array& position, const Array& rotation, const Array& displacement,
              const std::string& point, const Array& gravity, int threads) {
  const py::ssize_t n = count_of(position);
  return clamps(m, rows(position, {n, 3}, "position"), rows(rotation, {n, 3, 3}, "rotation"),
                rows(displacement, {n, 6}, "displacement"), m.point(point), vec3(gravity, "gravity"), threads);
}

Answers reactions_of(const Mechanism& m, const Array& position, const Array& rotation, const Array& wrench,
                     const std::string& point, const Array& gravity, int threads) {
  return reactions(m, loaded(position, rotation, wrench, gravity), m.point(point), threads);
}

Answers frames(const Mechanism& m, const Array& x) { return node_frames(m, vector(x, m.size(), "coordinates")); }

Answers positions_of(const Mechanism& m, const std::string& point, const Array& x) {
  return point_positions(m, m.point(point), rows(x, {count_of(x), m.size()}, "coordinates"));
}

Answers multipliers(const Array& frequency, const Array& ratio, const Array& mass, const Array& way, const Array& rest,
                    const Array& chips, const Array& period, const Array& depth, int threads) {
  const py::ssize_t n = count_of(frequency), k = count_of(chips);
  const ToolModes tool{vector(frequency, n, "frequency"), vector(ratio, n, "ratio"), vector(mass, n, "mass"),
                       rows(way, {n, 3}, "way").transpose(), mat3(rest, "rest")};
  const double* const numbers = data(chips, {k, 3, 2}, "chips");
  std::vector<Chip> cut;
  for (py::ssize_t i = 0; i < k; ++i)
    cut.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 2, Eigen::RowMajor>>(numbers + 6 * i));
  return largest_multipliers(tool, cut, vector(period, count_of(period), "period"),
                             vector(depth, count_of(depth), "depth"), threads);
}

}  // namespace

void bind_poses(py::module_& m) {
  using namespace py::literals;
  const py::call_guard<py::gil_scoped_release> free;
  py::class_<Mechanism>(m.attr("Mechanism"))
      .def_property_readonly("not_enclosed", &Encloser::missing)
      .def("closure", &closure, free, "plan"_a.none(true), "given"_a, "rotation"_a, "inverse"_a, "threads"_a,
           "start"_a = py::none())
      .def("kinematics", &kinematics_of, free, "position"_a, "rotation"_a, "start"_a, "weights"_a, "patient"_a,
           "only"_a, "threads"_a)
      .def("enclose", &enclose, free, "centre"_a, "half"_a, "axes"_a, "rotation"_a, "start"_a, "slopes"_a, "watched"_a,
           "threads"_a)
      .def("dynamics", &dynamics_of, free, "inertias"_a, "coordinates"_a, "twist"_a, "twist_rate"_a, "wrench"_a,
           "gravity"_a, "rates"_a, "accelerations"_a, "weights"_a, "threads"_a)
      .def("modes", &modes_of, free, "inertias"_a, "viscous"_a, "loss"_a, "position"_a, "rotation"_a, "wrench"_a,
           "gravity"_a, "closed"_a, "point"_a, "count"_a, "whole"_a, "threads"_a)
      .def("clamp", &clamp, free, "position"_a, "rotation"_a, "displacement"_a, "point"_a, "gravity"_a, "threads"_a)
      .def("reactions", &reactions_of, free, "position"_a, "rotation"_a, "wrench"_a, "point"_a, "gravity"_a,
           "threads"_a)
      .def("frames", &frames, free, "coordinates"_a)
      .def("point_positions", &positions_of, free, "point"_a, "coordinates"_a);
  m.def("multipliers", &multipliers, free, "frequency"_a, "ratio"_a, "mass"_a, "way"_a, "rest"_a, "chips"_a, "period"_a,
        "depth"_a, "threads"_a);
}

}  // namespace stiffmap::bindings
