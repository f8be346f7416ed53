// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include <optional>

#include "../../cpp/kernels/dispatch.hpp"
#include "answer.hpp"

namespace stiffmap::bindings {
namespace {

/// Ctrl-C ends a batch between two chunks.
void stop_where_interrupted() {
  py::gil_scoped_acquire held;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

std::vector<Index> point_indices(const Mechanism& m, const std::vector<std::string>& names) {
  std::vector<Index> out;
  for (const std::string& n : names) out.push_back(m.point(n));
  return out;
}

/// All poses in one call: by the kernels where a plan is given, else by the reference path. One row of rotations or
/// wrenches is meant for all.
Answer solve(const Mechanism& m, const FastPlan* plan, const Array& position, const Array& rotation,
             const Array& wrench, const std::vector<std::string>& load_points, const std::vector<int>& load_types,
             const std::vector<std::string>& read_points, const Array& gravity, int load_steps, int threads, bool full,
             const std::vector<const FastPlan*>& variants, const std::optional<Array>& closed) {
  const py::ssize_t n = position.ndim() ? position.shape(0) : 0;
  BatchInput in;
  in.count = n;
  in.position = data(position, {n, 3}, "position");
  in.one_rotation = rotation.ndim() > 0 && rotation.shape(0) == 1;
  in.one_wrench = wrench.ndim() > 0 && wrench.shape(0) == 1;
  in.rotation = data(rotation, {in.one_rotation ? 1 : n, 3, 3}, "rotation");
  in.wrench = data(wrench, {in.one_wrench ? 1 : n, static_cast<py::ssize_t>(load_points.size()), 6}, "wrench");
  if (closed) in.closed = data(*closed, {n, m.size()}, "closed coordinates");
  in.gravity = vec3(gravity, "gravity");
  in.poll = &stop_where_interrupted;
  in.read_points = point_indices(m, read_points);
  require(!in.read_points.empty(), "read_points", "at least one point", 0);
  require(load_types.size() == load_points.size(), "load_types", "one per load point", load_types.size());
  const std::vector<Index> at = point_indices(m, load_points);
  for (std::size_t i = 0; i < at.size(); ++i) {
    const NodePoint& p = m.points[static_cast<std::size_t>(at[i])];
    in.load_points.push_back({p.node, p.offset, static_cast<LoadType>(load_types[i])});
  }
  Answer answer(m, n, static_cast<py::ssize_t>(read_points.size()), static_cast<py::ssize_t>(variants.size()), full);
  in.variants = variants;
  if (!plan) std::fill_n(answer.variants.mutable_data(), answer.variants.size(), std::nan(""));
  SolveOptions options;
  options.equilibrium.load_steps = load_steps;
  options.stiffness = full;
  {
    py::gil_scoped_release free;
    if (plan) solve_fast(m, *plan, in, options, threads, answer.out);
    else solve_reference(m, in, options, threads, answer.out);
  }
  return answer;
}

}  // namespace

void bind_solve(py::module_& m) {
  using namespace py::literals;
  m.def("kernel_levels", &kernel_levels);
  m.def("kernel_level", [] { return std::string(kernel().level); });
  py::class_<Answer>(m, "Answer")
      .def_readonly("displacement", &Answer::displacement)
      .def_readonly("stiffness", &Answer::stiffness)
      .def_readonly("compliance", &Answer::compliance)
      .def_property_readonly("free_twists", &Answer::twists)
      .def_readonly("actuator_effort", &Answer::effort)
      .def_readonly("leg_wrench", &Answer::leg_wrench)
      .def_readonly("coordinates", &Answer::coordinates)
      .def_readonly("indeterminate", &Answer::indeterminate)
      .def_readonly("status", &Answer::status)
      .def_readonly("flags", &Answer::flags)
      .def_readonly("iterations", &Answer::iterations)
      .def_readonly("variants", &Answer::variants);
  py::class_<Mechanism>(m.attr("Mechanism"))
      .def("solve", &solve, "plan"_a.none(true), "position"_a, "rotation"_a, "wrench"_a, "load_points"_a,
           "load_types"_a, "read_points"_a, "gravity"_a, "load_steps"_a, "threads"_a, "full"_a,
           "variants"_a = std::vector<const FastPlan*>{}, "closed"_a = py::none());
}

}  // namespace stiffmap::bindings
