// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include <optional>

#include "../../cpp/kernels/dispatch.hpp"
#include "answer.hpp"
#include "stiffmap/parallel.hpp"

namespace stiffmap::bindings {
namespace {

/// Ctrl-C ends a batch between two chunks.
void stop_where_interrupted() {
  py::gil_scoped_acquire held;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

py::array_t<double> empty(const Shape& shape) { return py::array_t<double>(shape); }

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
  in.gravity = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
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

/// Coordinates and tip poses by closure: from poses, or from actuators; on the branch of `start` (poses x
/// coordinates) where it is given.
py::tuple closure(const Mechanism& m, const FastPlan* plan, const Array& given, const Array& rotation, bool inverse,
                  int threads, const std::optional<Array>& start) {
  const py::ssize_t n = given.shape(0), drives = static_cast<py::ssize_t>(m.drives.size());
  const double* values = data(given, {n, inverse ? 3 : drives}, inverse ? "position" : "actuators");
  const double* starts = start ? data(*start, {n, m.size()}, "start") : nullptr;
  const double* R = inverse ? data(rotation, {n, 3, 3}, "rotation") : nullptr;
  auto coordinates = empty({n, m.size()}), position = empty({n, 3}), turned = empty({n, 3, 3});
  py::array_t<std::uint8_t> status(n);
  py::array_t<std::uint32_t> flags(n);
  double *x_out = coordinates.mutable_data(), *p_out = position.mutable_data(), *r_out = turned.mutable_data();
  std::uint8_t* s_out = status.mutable_data();
  std::uint32_t* f_out = flags.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 64, threads, [&](int, long begin, long end) {
      ClosureWorkspace ws(m);
      VecX x = VecX::Zero(m.size()), from = x;
      Pose at;
      for (long i = begin; i < end; ++i) {
        const Vec3 p = inverse ? Vec3(Eigen::Map<const Vec3>(values + 3 * i)) : Vec3::Zero();
        const VecX a = inverse ? VecX() : VecX(Eigen::Map<const VecX>(values + drives * i, drives));
        ClosureResult r;
        if (starts) from = Eigen::Map<const VecX>(starts + m.size() * i, m.size());
        if (!inverse) r = starts ? forward_closure(m, a, ws, x, from) : forward_closure(m, a, ws, x);
        else if (starts) r = branch_closure(m, {p, Eigen::Map<const Row3>(R + 9 * i)}, ws, x, from);
        else if (plan && plan->nearest_start(m, p, from, at))
          r = inverse_closure(m, {p, Eigen::Map<const Row3>(R + 9 * i)}, ws, x, from, at);
        if (inverse && !starts && (r.status != Status::converged || r.flags & flag::branch_unverified))
          r = inverse_closure(m, {p, Eigen::Map<const Row3>(R + 9 * i)}, ws, x);
        const bool ok = r.status == Status::converged;
        Eigen::Map<VecX>(x_out + m.size() * i, m.size()) = ok ? x : VecX(VecX::Constant(m.size(), nan));
        Eigen::Map<Vec3>(p_out + 3 * i) = ok ? r.tip.p : Vec3(Vec3::Constant(nan));
        Eigen::Map<Row3>(r_out + 9 * i) = ok ? r.tip.R : Mat3(Mat3::Constant(nan));
        s_out[i] = static_cast<std::uint8_t>(r.status);
        f_out[i] = r.flags;
      }
    });
  }
  return py::make_tuple(coordinates, position, turned, status, flags);
}

/// Frames of all nodes at given coordinates, nominal geometry: for drawing.
py::tuple frames(const Mechanism& m, const Array& x) {
  Frames f(m);
  forward(m, Geometry::nominal, Eigen::Map<const VecX>(data(x, {m.size()}, "coordinates"), m.size()), f);
  const py::ssize_t n = static_cast<py::ssize_t>(f.pose.size());
  auto p = empty({n, 3}), R = empty({n, 3, 3});
  for (py::ssize_t i = 0; i < n; ++i) {
    Eigen::Map<Vec3>(p.mutable_data() + 3 * i) = f.pose[static_cast<std::size_t>(i)].p;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.mutable_data() + 9 * i) =
        f.pose[static_cast<std::size_t>(i)].R;
  }
  return py::make_tuple(p, R);
}

/// A named point at each row of coordinates, nominal geometry.
py::array_t<double> point_positions(const Mechanism& m, const std::string& name, const Array& x) {
  const NodePoint& point = m.points[static_cast<std::size_t>(m.point(name))];
  const py::ssize_t n = x.ndim() == 2 ? x.shape(0) : 0;
  const double* const rows = data(x, {n, m.size()}, "coordinates");
  auto p = empty({n, 3});
  Frames f(m);
  for (py::ssize_t i = 0; i < n; ++i) {
    forward(m, Geometry::nominal, Eigen::Map<const VecX>(rows + m.size() * i, m.size()), f);
    Eigen::Map<Vec3>(p.mutable_data() + 3 * i) = f.point(point.node, point.offset);
  }
  return p;
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
           "variants"_a = std::vector<const FastPlan*>{}, "closed"_a = py::none())
      .def("closure", &closure, "plan"_a.none(true), "given"_a, "rotation"_a, "inverse"_a, "threads"_a,
           "start"_a = py::none())
      .def("frames", &frames, "coordinates"_a)
      .def("point_positions", &point_positions, "point"_a, "coordinates"_a);
}

}  // namespace stiffmap::bindings
