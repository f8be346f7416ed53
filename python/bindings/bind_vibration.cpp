// SPDX-License-Identifier: MIT
// Modes at the tool of many poses, and multipliers of many speeds and depths: arrays in, arrays out.
#include <pybind11/stl.h>

#include <cmath>

#include "arrays.hpp"
#include "stiffmap/chatter.hpp"
#include "stiffmap/parallel.hpp"
#include "stiffmap/vibration.hpp"

namespace stiffmap::bindings {
namespace {

using RowsX = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Row6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

py::dict tip_modes_of(const Mechanism& m, const Array& inertias, const Array& viscous, const Array& loss,
                      const Array& position, const Array& rotation, const Array& wrench, const Array& gravity,
                      const Array& closed, const std::string& point, int count, int threads) {
  const py::ssize_t n = position.shape(0), bodies = static_cast<py::ssize_t>(m.bodies.size()), size = m.size();
  const double *p = data(position, {n, 3}, "position"), *R = data(rotation, {n, 3, 3}, "rotation"),
               *w = data(wrench, {n, 6}, "wrench"), *about = data(inertias, {bodies, 3, 3}, "inertias");
  const double* x0 = closed.ndim() && closed.shape(0) ? data(closed, {n, size}, "closed") : nullptr;
  const Vec3 g = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
  Inertias I;
  for (py::ssize_t k = 0; k < bodies; ++k) I.emplace_back(Eigen::Map<const Row3>(about + 9 * k));
  const Damping damping{Eigen::Map<const VecX>(data(viscous, {size}, "viscous"), size),
                        Eigen::Map<const VecX>(data(loss, {size}, "loss"), size)};
  const Index read = m.point(point);
  const NodePoint& named = m.points[static_cast<std::size_t>(read)];
  py::array_t<double> square({n, py::ssize_t(count)}), tip({n, py::ssize_t(6), py::ssize_t(count)}),
      dampers({n, py::ssize_t(count), py::ssize_t(count)}), lossy({n, py::ssize_t(count), py::ssize_t(count)}),
      rest({n, py::ssize_t(6), py::ssize_t(6)}), off(n);
  py::array_t<std::uint8_t> status(n);
  py::array_t<std::uint32_t> flags(n);
  double *ss = square.mutable_data(), *ts = tip.mutable_data(), *ds = dampers.mutable_data(),
         *ls = lossy.mutable_data(), *rs = rest.mutable_data(), *os = off.mutable_data();
  std::uint8_t* states = status.mutable_data();
  std::uint32_t* bits = flags.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 4, threads, [&](int, long begin, long end) {
      SolveWorkspace ws(m);
      VibrationResult r;
      PoseInput in;
      in.gravity = g;
      in.load_points = {{named.node, named.offset, LoadType::dead}};
      in.read_points = {read};
      for (long i = begin; i < end; ++i) {
        in.commanded = {Eigen::Map<const Vec3>(p + 3 * i), Mat3(Eigen::Map<const Row3>(R + 9 * i))};
        in.wrenches = {Vec6(Eigen::Map<const Vec6>(w + 6 * i))};
        in.closed = x0 && std::isfinite(x0[size * i]) ? x0 + size * i : nullptr;
        tip_modes(m, I, damping, in, count, ws, r);
        states[i] = static_cast<std::uint8_t>(r.status);
        bits[i] = r.flags;
        Eigen::Map<VecX>(ss + count * i, count) = r.square;
        Eigen::Map<RowsX>(ts + 6 * count * i, 6, count) = r.tip;
        Eigen::Map<RowsX>(ds + count * count * i, count, count) = r.viscous;
        Eigen::Map<RowsX>(ls + count * count * i, count, count) = r.loss;
        Eigen::Map<Row6>(rs + 36 * i) = r.rest;
        os[i] = r.unsymmetric;
      }
    });
  }
  py::dict out;
  out["square"] = square;
  out["tip"] = tip;
  out["viscous"] = dampers;
  out["loss"] = lossy;
  out["rest"] = rest;
  out["unsymmetric"] = off;
  out["status"] = status;
  out["flags"] = flags;
  return out;
}

/// |mu| of (n) tooth periods by (d) depths.
py::array_t<double> multipliers(const Array& frequency, const Array& ratio, const Array& mass, const Array& way,
                                const Array& rest, const Array& chips, const Array& period, const Array& depth,
                                int threads) {
  const py::ssize_t modes = frequency.shape(0), k = chips.shape(0), n = period.shape(0), d = depth.shape(0);
  ToolModes tool;
  tool.omega = Eigen::Map<const VecX>(data(frequency, {modes}, "frequency"), modes);
  tool.ratio = Eigen::Map<const VecX>(data(ratio, {modes}, "ratio"), modes);
  tool.mass = Eigen::Map<const VecX>(data(mass, {modes}, "mass"), modes);
  tool.way = Eigen::Map<const RowsX>(data(way, {modes, 3}, "way"), modes, 3).transpose();
  tool.rest = Eigen::Map<const Row3>(data(rest, {3, 3}, "rest"));
  const double* c = data(chips, {k, 3, 2}, "chips");
  std::vector<Chip> cut;
  for (py::ssize_t i = 0; i < k; ++i)
    cut.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 2, Eigen::RowMajor>>(c + 6 * i));
  const double* periods = data(period, {n}, "period");
  const VecX depths = Eigen::Map<const VecX>(data(depth, {d}, "depth"), d);
  py::array_t<double> out({n, d});
  double* found = out.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 1, threads, [&](int, long begin, long end) {
      for (long i = begin; i < end; ++i)
        Eigen::Map<VecX>(found + d * i, d) = largest_multipliers(tool, cut, periods[i], depths);
    });
  }
  return out;
}

}  // namespace

void bind_vibration(py::module_& m) {
  using namespace py::literals;
  py::class_<Mechanism>(m.attr("Mechanism"))
      .def("tip_modes", &tip_modes_of, "inertias"_a, "viscous"_a, "loss"_a, "position"_a, "rotation"_a, "wrench"_a,
           "gravity"_a, "closed"_a, "point"_a, "count"_a, "threads"_a);
  m.def("multipliers", &multipliers, "frequency"_a, "ratio"_a, "mass"_a, "way"_a, "rest"_a, "chips"_a, "period"_a,
        "depth"_a, "threads"_a);
}

}  // namespace stiffmap::bindings
