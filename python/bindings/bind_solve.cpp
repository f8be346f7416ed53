// SPDX-License-Identifier: MIT
#include "../../cpp/kernels/dispatch.hpp"
#include "answer.hpp"

namespace stiffmap::bindings {
namespace {

/// Ctrl-C ends a batch between two chunks.
void stop_where_interrupted() {
  py::gil_scoped_acquire held;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

/// All poses in one call: by the kernels where a plan is given, else by the reference path. One row of rotations or
/// wrenches is meant for all.
Answer solve(const Mechanism& m, const FastPlan* plan, const Rows& position, const Rows& rotation, const Rows& wrench,
             const std::vector<std::string>& load_points, const std::vector<int>& load_types,
             const std::vector<std::string>& read_points, const Vec3& gravity, int load_steps, int threads, bool full,
             const std::vector<const FastPlan*>& variants, const Rows& closed) {
  BatchInput in;
  in.count = position.rows();
  in.gravity = gravity;
  in.poll = &stop_where_interrupted;
  in.variants = variants;
  require(load_types.size() == load_points.size(), "load_types", "one per load point", load_types.size());
  for (std::size_t i = 0; i < load_points.size(); ++i)
    in.load_points.push_back(load_at(m, m.point(load_points[i]), static_cast<LoadType>(load_types[i])));
  for (const std::string& name : read_points) in.read_points.push_back(m.point(name));
  in.take(m, position, rotation, wrench, closed);
  Answer answer(m, in.count, static_cast<py::ssize_t>(read_points.size()), static_cast<py::ssize_t>(variants.size()),
                full);
  SolveOptions options;
  options.equilibrium.load_steps = load_steps;
  options.stiffness = full;
  py::gil_scoped_release free;
  solve_batch(m, plan, in, options, threads, answer.out);
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
           "load_types"_a, "read_points"_a, "gravity"_a, "load_steps"_a, "threads"_a, "full"_a, "variants"_a,
           "closed"_a);
}

}  // namespace stiffmap::bindings
