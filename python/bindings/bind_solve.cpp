// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include "../../cpp/kernels/dispatch.hpp"
#include "arrays.hpp"
#include "stiffmap/batch.hpp"
#include "stiffmap/parallel.hpp"

namespace stiffmap::bindings {
namespace {

using Shape = std::vector<py::ssize_t>;

py::array_t<double> empty(const Shape& shape) { return py::array_t<double>(shape); }

std::vector<Index> point_indices(const Mechanism& m, const std::vector<std::string>& names) {
  std::vector<Index> out;
  for (const std::string& n : names) out.push_back(m.point(n));
  return out;
}

/// Arrays of one call; every array has the pose as its leading axis.
struct Answer {
  Answer(const Mechanism& m, py::ssize_t n, py::ssize_t reads, bool full)
      : displacement(Shape{n, reads, 6}), status(n), flags(n), iterations(n) {
    const py::ssize_t legs = static_cast<py::ssize_t>(m.legs.size()), k = full ? n : 0;
    for (py::array_t<double>* a : {&stiffness, &compliance, &free_twists}) *a = empty({k, 6, 6});
    effort = empty({k, static_cast<py::ssize_t>(m.drives.size())});
    leg_wrench = empty({k, legs, 6});
    coordinates = empty({k, m.size()});
    indeterminate = py::array_t<std::uint8_t>(Shape{k, m.size()});
    out.displacement = displacement.mutable_data();
    out.status = status.mutable_data();
    out.flags = flags.mutable_data();
    out.iterations = iterations.mutable_data();
    if (!full) return;
    out.stiffness = stiffness.mutable_data();
    out.compliance = compliance.mutable_data();
    out.free_twists = free_twists.mutable_data();
    out.effort = effort.mutable_data();
    out.leg_wrench = leg_wrench.mutable_data();
    out.coordinates = coordinates.mutable_data();
    out.indeterminate = indeterminate.mutable_data();
  }

  py::dict dict() const {
    py::dict d;
    d["displacement"] = displacement;
    d["stiffness"] = stiffness;
    d["compliance"] = compliance;
    d["free_twists"] = free_twists;
    d["actuator_effort"] = effort;
    d["leg_wrench"] = leg_wrench;
    d["coordinates"] = coordinates;
    d["indeterminate"] = indeterminate;
    d["status"] = status;
    d["flags"] = flags;
    d["iterations"] = iterations;
    return d;
  }

  py::array_t<double> displacement, stiffness, compliance, free_twists, effort, leg_wrench, coordinates;
  py::array_t<std::uint8_t> indeterminate, status;
  py::array_t<std::uint32_t> flags;
  py::array_t<std::int32_t> iterations;
  BatchOutput out;
};

/// All poses in one call: by the kernels where a plan is given, else by the reference path.
py::dict solve(const Mechanism& m, const FastPlan* plan, const Array& position, const Array& rotation,
               const Array& wrench, const std::vector<std::string>& load_points, const std::vector<int>& load_types,
               const std::vector<std::string>& read_points, const Array& gravity, int load_steps, int threads,
               bool full, const std::vector<const FastPlan*>& variants) {
  const py::ssize_t n = position.ndim() ? position.shape(0) : 0;
  BatchInput in;
  in.count = n;
  in.position = data(position, {n, 3}, "position");
  in.rotation = data(rotation, {n, 3, 3}, "rotation");
  in.wrench = data(wrench, {n, static_cast<py::ssize_t>(load_points.size()), 6}, "wrench");
  in.gravity = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
  in.read_points = point_indices(m, read_points);
  require(!in.read_points.empty(), "read_points", "at least one point", 0);
  require(load_types.size() == load_points.size(), "load_types", "one per load point", load_types.size());
  const std::vector<Index> at = point_indices(m, load_points);
  for (std::size_t i = 0; i < at.size(); ++i) {
    const NodePoint& p = m.points[static_cast<std::size_t>(at[i])];
    in.load_points.push_back({p.node, p.offset, static_cast<LoadType>(load_types[i])});
  }
  Answer answer(m, n, static_cast<py::ssize_t>(read_points.size()), full);
  const py::ssize_t moved = static_cast<py::ssize_t>(variants.size());
  auto varied = empty({moved ? n : 0, moved, 6});
  if (moved) {
    in.variants = variants;
    answer.out.variants = varied.mutable_data();
    if (!plan) std::fill(varied.mutable_data(), varied.mutable_data() + varied.size(), std::nan(""));
  }
  SolveOptions options;
  options.equilibrium.load_steps = load_steps;
  options.stiffness = full;
  {
    py::gil_scoped_release free;
    if (plan) solve_fast(m, *plan, in, options, threads, answer.out);
    else solve_reference(m, in, options, threads, answer.out);
  }
  py::dict d = answer.dict();
  d["variants"] = varied;
  return d;
}

template <class T, class Get>
std::vector<std::string> names(const std::vector<T>& items, Get get) {
  std::vector<std::string> out;
  for (const T& item : items) out.push_back(get(item));
  return out;
}

/// Coordinates and tip poses by closure: from poses, or from actuators.
py::tuple closure(const Mechanism& m, const FastPlan* plan, const Array& given, const Array& rotation, bool inverse,
                  int threads) {
  const py::ssize_t n = given.shape(0), drives = static_cast<py::ssize_t>(m.drives.size());
  const double* values = data(given, {n, inverse ? 3 : drives}, inverse ? "position" : "actuators");
  const double* R = inverse ? data(rotation, {n, 3, 3}, "rotation") : nullptr;
  auto coordinates = empty({n, m.size()}), position = empty({n, 3}), turned = empty({n, 3, 3});
  py::array_t<std::uint8_t> status(n);
  py::array_t<std::uint32_t> flags(n);
  double *x_out = coordinates.mutable_data(), *p_out = position.mutable_data(), *r_out = turned.mutable_data();
  std::uint8_t* s_out = status.mutable_data();
  std::uint32_t* f_out = flags.mutable_data();
  using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 64, threads, [&](int, long begin, long end) {
      ClosureWorkspace ws(m);
      VecX x = VecX::Zero(m.size()), from = x;
      Pose at;
      for (long i = begin; i < end; ++i) {
        const Vec3 p = inverse ? Vec3(Eigen::Map<const Vec3>(values + 3 * i)) : Vec3::Zero();
        ClosureResult r;
        if (!inverse) r = forward_closure(m, Eigen::Map<const VecX>(values + drives * i, drives), ws, x);
        else if (plan && plan->nearest_start(m, p, from, at))
          r = inverse_closure(m, {p, Eigen::Map<const Row3>(R + 9 * i)}, ws, x, from, at);
        if (inverse && (r.status != Status::converged || r.flags & flag::branch_unverified))
          r = inverse_closure(m, {p, Eigen::Map<const Row3>(R + 9 * i)}, ws, x);
        const bool ok = r.status == Status::converged;
        const double nan = std::numeric_limits<double>::quiet_NaN();
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

}  // namespace

void bind_solve(py::module_& m) {
  using namespace py::literals;
  m.def("kernel_levels", &kernel_levels);
  m.def("kernel_level", [] { return std::string(kernel().level); });
  py::class_<Mechanism> mechanism(m, "Mechanism");  // before the signatures that name it
  py::class_<FastPlan>(m, "FastPlan")
      .def(py::init([](const Mechanism& k, const Array& low, const Array& high) {
             const Vec3 a = Eigen::Map<const Vec3>(data(low, {3}, "low")),
                        b = Eigen::Map<const Vec3>(data(high, {3}, "high"));
             py::gil_scoped_release free;
             return std::make_unique<FastPlan>(k, a, b);
           }),
           "mechanism"_a, "low"_a, "high"_a)
      .def_property_readonly("available", &FastPlan::available)
      .def_property_readonly("missing", &FastPlan::missing);
  mechanism.def(py::init(&assemble), "root"_a, "home"_a, "springs"_a, "task"_a = full_task)
      .def_property_readonly(
          "coordinates",
          [](const Mechanism& k) { return names(k.coordinates, [](const Coordinate& c) { return c.name; }); })
      .def_property_readonly("roles",
                             [](const Mechanism& k) {
                               std::vector<int> out;
                               for (const Coordinate& c : k.coordinates) out.push_back(static_cast<int>(c.role));
                               return out;
                             })
      .def_property_readonly("prismatic",
                             [](const Mechanism& k) {
                               std::vector<bool> out;
                               for (const Coordinate& c : k.coordinates) out.push_back(c.type == JointType::prismatic);
                               return out;
                             })
      .def_property_readonly("locked",
                             [](const Mechanism& k) {
                               std::vector<bool> out;
                               for (const Coordinate& c : k.coordinates) out.push_back(c.locked);
                               return out;
                             })
      .def_property_readonly("springs",
                             [](const Mechanism& k) {
                               std::vector<std::pair<std::string, Index>> out;
                               for (const SpringGroup& g : k.groups) out.emplace_back(g.name, g.first);
                               return out;
                             })
      .def_property_readonly("actuators",
                             [](const Mechanism& k) {
                               std::vector<std::pair<std::string, Index>> out;
                               for (const Drive& d : k.drives) out.emplace_back(d.name, d.coordinate);
                               return out;
                             })
      .def_property_readonly("nodes",
                             [](const Mechanism& k) {
                               std::vector<std::pair<Index, Index>> out;  // parent, coordinate
                               for (const Node& n : k.nodes) out.emplace_back(n.parent, n.coordinate);
                               return out;
                             })
      .def_property_readonly("loops",
                             [](const Mechanism& k) {
                               std::vector<std::tuple<std::string, std::string, Index, Index>> out;
                               for (const Loop& l : k.loops) out.emplace_back(l.block, l.branch, l.primary, l.end);
                               return out;
                             })
      .def_property_readonly(
          "points", [](const Mechanism& k) { return names(k.points, [](const NodePoint& p) { return p.name; }); })
      .def_property_readonly("legs", [](const Mechanism& k) { return k.legs; })
      .def_readonly("length", &Mechanism::length)
      .def_readonly("stiffness", &Mechanism::stiffness)
      .def("home_coordinates",
           [](const Mechanism& k) {
             py::array_t<double> out(k.size());
             Eigen::Map<VecX>(out.mutable_data(), k.size()) = k.home_coordinates;
             return out;
           })
      .def("solve", &solve, "plan"_a.none(true), "position"_a, "rotation"_a, "wrench"_a, "load_points"_a,
           "load_types"_a, "read_points"_a, "gravity"_a, "load_steps"_a, "threads"_a, "full"_a,
           "variants"_a = std::vector<const FastPlan*>{})
      .def("closure", &closure, "plan"_a.none(true), "given"_a, "rotation"_a, "inverse"_a, "threads"_a)
      .def("frames", &frames, "coordinates"_a);
}

}  // namespace stiffmap::bindings
