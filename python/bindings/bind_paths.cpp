// SPDX-License-Identifier: MIT
// Imposed displacements, load paths and reactions.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "stiffmap/clamp.hpp"
#include "stiffmap/parallel.hpp"
#include "stiffmap/path.hpp"

namespace stiffmap::bindings {
namespace {

using Shape = std::vector<py::ssize_t>;
using Row6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

py::array_t<double> vector(const VecX& v) {
  py::array_t<double> out(v.size());
  Eigen::Map<VecX>(out.mutable_data(), v.size()) = v;
  return out;
}

Pose pose(const double* p, const double* R) { return {Eigen::Map<const Vec3>(p), Eigen::Map<const Row3>(R)}; }

/// Wrenches that hold a point at displacements from its commanded poses.
py::dict clamp(const Mechanism& m, const Array& position, const Array& rotation, const Array& displacement,
               const std::string& point, const Array& gravity, int threads) {
  const py::ssize_t n = position.shape(0), legs = static_cast<py::ssize_t>(m.legs.size());
  const py::ssize_t drives = static_cast<py::ssize_t>(m.drives.size());
  const double *p = data(position, {n, 3}, "position"), *R = data(rotation, {n, 3, 3}, "rotation");
  const double* d = data(displacement, {n, 6}, "displacement");
  const Vec3 g = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
  const Index at = m.point(point);
  py::array_t<double> wrench(Shape{n, 6}), leg_wrench(Shape{n, legs, 6}), stiffness(Shape{n, 6, 6});
  py::array_t<double> leg_stiffness(Shape{n, legs, 6, 6}), effort(Shape{n, drives}), coordinates(Shape{n, m.size()});
  py::array_t<std::uint8_t> status(n), free_status(n);
  py::array_t<std::uint32_t> flags(n);
  double *w = wrench.mutable_data(), *lw = leg_wrench.mutable_data(), *k = stiffness.mutable_data();
  double *lk = leg_stiffness.mutable_data(), *e = effort.mutable_data(), *x = coordinates.mutable_data();
  std::uint8_t *s = status.mutable_data(), *fs = free_status.mutable_data();
  std::uint32_t* f = flags.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 8, threads, [&](int, long begin, long end) {
      Clamp held(m, at);
      ClampResult r;
      for (long i = begin; i < end; ++i) {
        PoseInput in;
        in.commanded = pose(p + 3 * i, R + 9 * i);
        in.gravity = g;
        in.read_points = {at};
        held.solve(in, Eigen::Map<const Vec6>(d + 6 * i), r);
        Eigen::Map<Vec6>(w + 6 * i) = r.wrench;
        Eigen::Map<Row6>(k + 36 * i) = r.pose.point.stiffness;
        for (py::ssize_t l = 0; l < legs; ++l) {
          Eigen::Map<Vec6>(lw + 6 * (legs * i + l)) = r.pose.leg_wrench.col(l);
          Eigen::Map<Row6>(lk + 36 * (legs * i + l)) = r.leg_stiffness[static_cast<std::size_t>(l)];
        }
        Eigen::Map<VecX>(e + drives * i, drives) = r.pose.effort;
        Eigen::Map<VecX>(x + m.size() * i, m.size()) = r.pose.x;
        s[i] = static_cast<std::uint8_t>(r.status);
        fs[i] = static_cast<std::uint8_t>(r.pose.status);
        f[i] = r.flags;
      }
    });
  }
  py::dict out;
  out["wrench"] = wrench;
  out["leg_wrench"] = leg_wrench;
  out["stiffness"] = stiffness;
  out["leg_stiffness"] = leg_stiffness;
  out["actuator_effort"] = effort;
  out["coordinates"] = coordinates;
  out["status"] = status;
  out["force_status"] = free_status;
  out["flags"] = flags;
  return out;
}

py::dict as_dict(const PathPoint& p) {
  py::dict d;
  d["load"] = p.load;
  d["along"] = p.along;
  d["displacement"] = vector(p.displacement);
  d["coordinates"] = vector(p.x);
  d["unstable"] = p.unstable;
  return d;
}

py::dict as_dict(const CriticalPoint& c) {
  py::dict d;
  d["load"] = c.load;
  d["along"] = c.along;
  d["limit"] = c.limit;
  d["before"] = c.before;
  d["after"] = c.after;
  d["mode"] = vector(c.mode);
  d["coordinates"] = vector(c.x);
  return d;
}

py::tuple as_tuple(const Branch& b) {
  py::list points, critical;
  for (const PathPoint& p : b.points) points.append(as_dict(p));
  for (const CriticalPoint& c : b.critical) critical.append(as_dict(c));
  return py::make_tuple(static_cast<int>(b.end), points, critical);
}

/// One path of equilibria, and the branch that crosses it.
py::tuple path(const Mechanism& m, const Array& position, const Array& rotation, const Array& direction,
               const std::string& point, const Array& gravity, int control, double limit, int steps, int cross) {
  PoseInput in;
  in.commanded = pose(data(position, {3}, "position"), data(rotation, {3, 3}, "rotation"));
  in.gravity = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
  in.read_points = {m.point(point)};
  const Vec3 d = Eigen::Map<const Vec3>(data(direction, {3}, "direction"));
  PathResult r;
  {
    py::gil_scoped_release free;
    PathOptions o;
    o.control = static_cast<PathControl>(control);
    o.limit = limit;
    o.steps = steps;
    o.cross = cross;
    r = follow_path(m, in, d, o);
  }
  return py::make_tuple(r.flags, as_tuple(r.path), as_tuple(r.crossing));
}

/// Generalised forces of all springs, drives and locked coordinates at loaded poses.
py::tuple reactions(const Mechanism& m, const Array& position, const Array& rotation, const Array& wrench,
                    const std::string& point, const Array& gravity, int threads) {
  const py::ssize_t n = position.shape(0);
  const double *p = data(position, {n, 3}, "position"), *R = data(rotation, {n, 3, 3}, "rotation");
  const double* w = data(wrench, {n, 6}, "wrench");
  const Vec3 g = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
  const NodePoint& load = m.points[static_cast<std::size_t>(m.point(point))];
  py::array_t<double> out(Shape{n, m.size()});
  double* o = out.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 16, threads, [&](int, long begin, long end) {
      SolveWorkspace ws(m);
      PoseResult r;
      PoseInput in;
      in.gravity = g;
      in.load_points = {{load.node, load.offset, LoadType::dead}};
      in.read_points = {m.point(point)};
      for (long i = begin; i < end; ++i) {
        in.commanded = pose(p + 3 * i, R + 9 * i);
        in.wrenches = {Eigen::Map<const Vec6>(w + 6 * i)};
        solve_pose(m, in, {}, ws, r);
        const bool known = r.status == Status::converged || r.status == Status::unstable;
        const Linearization& lin = ws.equilibrium.lin;
        Eigen::Map<VecX>(o + m.size() * i, m.size()) =
            known ? VecX(lin.tau - lin.r) : VecX(VecX::Constant(m.size(), nan));
      }
    });
  }
  return py::make_tuple(out);
}

}  // namespace

void bind_paths(py::module_& m) {
  using namespace py::literals;
  m.def("clamp", &clamp, "mechanism"_a, "position"_a, "rotation"_a, "displacement"_a, "point"_a, "gravity"_a,
        "threads"_a);
  m.def("path", &path, "mechanism"_a, "position"_a, "rotation"_a, "direction"_a, "point"_a, "gravity"_a, "control"_a,
        "limit"_a, "steps"_a, "cross"_a);
  m.def("reactions", &reactions, "mechanism"_a, "position"_a, "rotation"_a, "wrench"_a, "point"_a, "gravity"_a,
        "threads"_a);
}

}  // namespace stiffmap::bindings
