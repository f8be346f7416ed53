// SPDX-License-Identifier: MIT
// Load paths.
#include "arrays.hpp"
#include "stiffmap/solve/path.hpp"

namespace stiffmap::bindings {
namespace {

using namespace py::literals;

py::dict as_dict(const PathPoint& p) {
  return py::dict("load"_a = p.load, "along"_a = p.along, "displacement"_a = p.displacement, "coordinates"_a = p.x,
                  "unstable"_a = p.unstable);
}

py::dict as_dict(const CriticalPoint& c) {
  return py::dict("load"_a = c.load, "along"_a = c.along, "limit"_a = c.limit, "before"_a = c.before,
                  "after"_a = c.after, "mode"_a = c.mode, "coordinates"_a = c.x);
}

py::tuple as_tuple(const Branch& b) {
  py::list points, critical;
  for (const PathPoint& p : b.points) points.append(as_dict(p));
  for (const CriticalPoint& c : b.critical) critical.append(as_dict(c));
  return py::make_tuple(static_cast<int>(b.end), points, critical);
}

/// One path of equilibria, and the branch that crosses it.
py::tuple path(const Mechanism& m, const Vec3& position, const Mat3& rotation, const Vec3& direction,
               const std::string& point, const Vec3& gravity, int control, double limit, int steps, int cross) {
  PoseInput in;
  in.commanded = {position, rotation};
  in.gravity = gravity;
  in.read_points = {m.point(point)};
  PathOptions o;
  o.control = static_cast<PathControl>(control);
  o.limit = limit;
  o.steps = steps;
  o.cross = cross;
  PathResult r;
  {
    py::gil_scoped_release free;
    r = follow_path(m, in, direction, o);
  }
  return py::make_tuple(r.flags, as_tuple(r.path), as_tuple(r.crossing));
}

}  // namespace

void bind_paths(py::module_& m) {
  m.def("path", &path, "mechanism"_a, "position"_a, "rotation"_a, "direction"_a, "point"_a, "gravity"_a, "control"_a,
        "limit"_a, "steps"_a, "cross"_a);
}

}  // namespace stiffmap::bindings
