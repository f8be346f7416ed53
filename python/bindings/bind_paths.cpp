// SPDX-License-Identifier: MIT
// Load paths.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "stiffmap/solve/path.hpp"

namespace stiffmap::bindings {
namespace {

py::array_t<double> array(const VecX& v) {
  py::array_t<double> out(v.size());
  Eigen::Map<VecX>(out.mutable_data(), v.size()) = v;
  return out;
}

py::dict as_dict(const PathPoint& p) {
  py::dict d;
  d["load"] = p.load;
  d["along"] = p.along;
  d["displacement"] = array(p.displacement);
  d["coordinates"] = array(p.x);
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
  d["mode"] = array(c.mode);
  d["coordinates"] = array(c.x);
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
  in.commanded = {vec3(position, "position"), mat3(rotation, "rotation")};
  in.gravity = vec3(gravity, "gravity");
  in.read_points = {m.point(point)};
  const Vec3 d = vec3(direction, "direction");
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

}  // namespace

void bind_paths(py::module_& m) {
  using namespace py::literals;
  m.def("path", &path, "mechanism"_a, "position"_a, "rotation"_a, "direction"_a, "point"_a, "gravity"_a, "control"_a,
        "limit"_a, "steps"_a, "cross"_a);
}

}  // namespace stiffmap::bindings
