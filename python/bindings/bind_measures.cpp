// SPDX-License-Identifier: MIT
// Rates, dynamics and modes of many poses: arrays in, arrays out.
#include <pybind11/stl.h>

#include <cmath>

#include "arrays.hpp"
#include "stiffmap/enclosure.hpp"
#include "stiffmap/modes.hpp"
#include "stiffmap/parallel.hpp"
#include "stiffmap/pose_closer.hpp"

namespace stiffmap::bindings {
namespace {

using RowX = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// An array full of NaN.
py::array_t<double> unknown(const std::vector<py::ssize_t>& shape) {
  py::array_t<double> out(shape);
  std::fill_n(out.mutable_data(), out.size(), nan);
  return out;
}

py::ssize_t count_of(const Array& a) { return a.ndim() ? a.shape(0) : 0; }

Inertias inertias_of(const Mechanism& m, const Array& values) {
  const py::ssize_t n = static_cast<py::ssize_t>(m.bodies.size());
  const double* from = data(values, {n, 3, 3}, "inertias");
  Inertias out;
  for (py::ssize_t k = 0; k < n; ++k) out.emplace_back(Eigen::Map<const Row3>(from + 9 * k));
  return out;
}

/// Weights of the drives: one each, or none.
VecX drive_weights(const Mechanism& m, const Array& values) {
  const py::ssize_t drives = static_cast<py::ssize_t>(m.drives.size());
  if (count_of(values) == 0) return {};
  return Eigen::Map<const VecX>(data(values, {drives}, "weights"), drives);
}

/// Coordinates, drive Jacobian and, where wanted, the rates of all coordinates. `start`: coordinates near
/// the answer (NaN: none known), or no rows. `only`: poses are continued from their starts and nowhere else.
py::dict kinematics(const Mechanism& m, const Array& position, const Array& rotation, const Array& start,
                    const Array& weights, bool rates, bool patient, bool only, int threads) {
  const py::ssize_t n = count_of(position), size = m.size(), drives = static_cast<py::ssize_t>(m.drives.size());
  const double *p = data(position, {n, 3}, "position"), *R = data(rotation, {n, 3, 3}, "rotation");
  const double* x0 = count_of(start) ? data(start, {n, size}, "start") : nullptr;
  auto x_out = unknown({n, size}), J_out = unknown({n, 6, drives}), free_out = unknown({n, 6}), pivot = unknown({n});
  auto tip_out = unknown({n, 3}), turned = unknown({n, 3, 3}), rates_out = unknown({rates ? n : 0, size, drives});
  auto sharing = unknown({n, drives, drives});
  const VecX shares = drive_weights(m, weights);
  py::array_t<std::int32_t> together(n);
  std::fill_n(together.mutable_data(), n, static_cast<std::int32_t>(drives));
  std::int32_t* const tos = together.mutable_data();
  py::array_t<std::uint8_t> status(n);
  py::array_t<std::uint32_t> flags(n);
  double *xs = x_out.mutable_data(), *Js = J_out.mutable_data(), *fs = free_out.mutable_data(),
         *ps = pivot.mutable_data(), *ts = tip_out.mutable_data(), *Rs = turned.mutable_data(),
         *gs = rates_out.mutable_data(), *ms = sharing.mutable_data();
  std::uint8_t* states = status.mutable_data();
  std::uint32_t* bits = flags.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 64, threads, [&](int, long begin, long end) {
      PoseCloser closer(m);
      LoopRates loops(m);
      Motion motion;
      VecX x(m.size());
      for (long i = begin; i < end; ++i) {
        if (x0) x = Eigen::Map<const VecX>(x0 + size * i, size);
        else x.setConstant(nan);
        const Pose pose{Eigen::Map<const Vec3>(p + 3 * i), Mat3(Eigen::Map<const Row3>(R + 9 * i))};
        const ClosureResult r = only ? closer.continue_from(m, pose, x) : closer.close(m, pose, x, patient);
        states[i] = static_cast<std::uint8_t>(r.status);
        bits[i] = r.flags;
        if (r.status != Status::converged) continue;
        loops.factorise(m, closer.frames());
        loops.motion(m, closer.frames(), motion, shares);
        Eigen::Map<VecX>(xs + size * i, size) = x;
        Eigen::Map<Vec3>(ts + 3 * i) = r.tip.p;
        Eigen::Map<Row3>(Rs + 9 * i) = r.tip.R;
        ps[i] = motion.pivot;
        Eigen::Map<RowX>(ms + drives * drives * i, drives, drives) = motion.sharing;
        tos[i] = static_cast<std::int32_t>(motion.together);
        Eigen::Map<Vec6>(fs + 6 * i) = motion.free_twist;
        if (!motion.free_twist.hasNaN()) {
          states[i] = static_cast<std::uint8_t>(Status::singular);
          bits[i] |= flag::platform_singular;
          continue;
        }
        Eigen::Map<RowX>(Js + 6 * drives * i, 6, drives) = motion.J;
        if (rates) Eigen::Map<RowX>(gs + size * drives * i, size, drives) = motion.rates;
      }
    });
  }
  py::dict out;
  out["coordinates"] = x_out;
  out["position"] = tip_out;
  out["rotation"] = turned;
  out["jacobian"] = J_out;
  out["rates"] = rates_out;
  out["free_twist"] = free_out;
  out["pivot"] = pivot;
  out["sharing"] = sharing;
  out["together"] = together;
  out["status"] = status;
  out["flags"] = flags;
  return out;
}

/// Coordinates and their slopes over cells: centre + axes * d, |d_k| <= half_k. `start` as above.
py::dict enclose(const Mechanism& m, const Array& centre, const Array& half, const Array& axes, const Array& rotation,
                 const Array& start, int slopes, const std::vector<Index>& watched, int threads) {
  const py::ssize_t n = count_of(centre), size = m.size(), nodes = static_cast<py::ssize_t>(watched.size());
  const double *p = data(centre, {n, 3}, "centre"), *h = data(half, {n, 3}, "half");
  const Mat3 R = Eigen::Map<const Row3>(data(rotation, {3, 3}, "rotation")),
             along = Eigen::Map<const Row3>(data(axes, {3, 3}, "axes"));
  const double* x0 = count_of(start) ? data(start, {n, size}, "start") : nullptr;
  auto x_out = unknown({n, size}), slope = unknown({n, size, slopes}), radius = unknown({n, size}),
       change = unknown({n, 3, size, slopes}), slack = unknown({n, size, slopes}), moved = unknown({n, nodes}),
       position = unknown({n, nodes, 3}), bend = unknown({n, 3});
  py::array_t<bool> enclosed(n), closed(n);
  double *xs = x_out.mutable_data(), *ss = slope.mutable_data(), *rs = radius.mutable_data(),
         *cs = change.mutable_data(), *ks = slack.mutable_data(), *ms = moved.mutable_data(),
         *ps = position.mutable_data(), *bs = bend.mutable_data();
  bool *good = enclosed.mutable_data(), *shut = closed.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 16, threads, [&](int, long begin, long end) {
      PoseCloser closer(m);
      Encloser encloser(m);
      Enclosure e;
      VecX x(m.size());
      for (long i = begin; i < end; ++i) {
        if (x0) x = Eigen::Map<const VecX>(x0 + size * i, size);
        else x.setConstant(nan);
        const ClosureResult r = closer.close(m, {Eigen::Map<const Vec3>(p + 3 * i), R}, x, false);
        shut[i] = r.status == Status::converged;
        good[i] = false;
        if (!shut[i]) continue;
        Eigen::Map<VecX>(xs + size * i, size) = x;
        encloser.enclose(m, closer.frames(), x, along, Eigen::Map<const Vec3>(h + 3 * i), slopes, watched, e);
        for (py::ssize_t k = 0; k < nodes; ++k)
          Eigen::Map<Vec3>(ps + 3 * (nodes * i + k)) = closer.frames().at(watched[static_cast<std::size_t>(k)]).p;
        Eigen::Map<Vec3>(bs + 3 * i) = e.bend;
        if (!e.enclosed) continue;
        good[i] = true;
        Eigen::Map<RowX>(ss + slopes * size * i, size, slopes) = e.G;
        Eigen::Map<RowX>(ks + slopes * size * i, size, slopes) = e.slack;
        Eigen::Map<VecX>(rs + size * i, size) = e.radius;
        Eigen::Map<VecX>(ms + nodes * i, nodes) = e.moved;
        for (py::ssize_t k = 0; k < 3; ++k)
          Eigen::Map<RowX>(cs + slopes * size * (3 * i + k), size, slopes) = e.change[static_cast<std::size_t>(k)];
      }
    });
  }
  py::dict out;
  out["closed"] = closed;
  out["enclosed"] = enclosed;
  out["coordinates"] = x_out;
  out["slope"] = slope;
  out["radius"] = radius;
  out["change"] = change;
  out["slack"] = slack;
  out["points"] = position;
  out["moved"] = moved;
  out["bend"] = bend;
  return out;
}

/// Drive efforts at closed coordinates and tip motions; rates and accelerations of the drives: as many rows, or none.
py::dict dynamics(const Mechanism& m, const Array& inertias, const Array& coordinates, const Array& twist,
                  const Array& twist_rate, const Array& wrench, const Array& gravity, const Array& rates,
                  const Array& accelerations, const Array& weights, int threads) {
  const py::ssize_t n = count_of(coordinates), size = m.size(), drives = static_cast<py::ssize_t>(m.drives.size());
  const double *x = data(coordinates, {n, size}, "coordinates"), *v = data(twist, {n, 6}, "twist"),
               *a = data(twist_rate, {n, 6}, "twist_rate"), *w = data(wrench, {n, 6}, "wrench");
  const Vec3 g = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
  const double *given = count_of(rates) ? data(rates, {n, drives}, "rates") : nullptr,
               *given_too = given ? data(accelerations, {n, drives}, "accelerations") : nullptr;
  const VecX shares = drive_weights(m, weights);
  const Inertias I = inertias_of(m, inertias);
  auto effort = unknown({n, drives}), rate = unknown({n, drives}), acceleration = unknown({n, drives}),
       mass = unknown({n, drives, drives}), kinetic = unknown({n}), potential = unknown({n}), misfit = unknown({n});
  double *es = effort.mutable_data(), *rs = rate.mutable_data(), *as = acceleration.mutable_data(),
         *ms = mass.mutable_data(), *ks = kinetic.mutable_data(), *ps = potential.mutable_data(),
         *fs = misfit.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 64, threads, [&](int, long begin, long end) {
      Frames frames(m);
      LoopRates loops(m);
      Motion motion;
      DynamicsResult r;
      for (long i = begin; i < end; ++i) {
        const VecX at = Eigen::Map<const VecX>(x + size * i, size);
        if (!at.allFinite()) continue;
        forward(m, Geometry::nominal, at, frames);
        loops.factorise(m, frames);
        loops.motion(m, frames, motion, shares);
        if (!motion.free_twist.hasNaN()) continue;
        DynamicsInput in{Eigen::Map<const Vec6>(v + 6 * i),
                         Eigen::Map<const Vec6>(a + 6 * i),
                         Eigen::Map<const Vec6>(w + 6 * i),
                         g,
                         {},
                         {}};
        if (given) in.rate = Eigen::Map<const VecX>(given + drives * i, drives);
        if (given) in.acceleration = Eigen::Map<const VecX>(given_too + drives * i, drives);
        drive_dynamics(m, I, at, frames, loops, motion, in, r);
        Eigen::Map<VecX>(es + drives * i, drives) = r.effort;
        Eigen::Map<VecX>(rs + drives * i, drives) = r.rate;
        Eigen::Map<VecX>(as + drives * i, drives) = r.acceleration;
        Eigen::Map<RowX>(ms + drives * drives * i, drives, drives) = r.mass;
        ks[i] = r.kinetic;
        ps[i] = r.potential;
        fs[i] = r.misfit;
      }
    });
  }
  py::dict out;
  out["effort"] = effort;
  out["rate"] = rate;
  out["acceleration"] = acceleration;
  out["mass"] = mass;
  out["kinetic"] = kinetic;
  out["potential"] = potential;
  out["misfit"] = misfit;
  return out;
}

/// Squares of angular frequencies and shapes of the lowest modes.
py::dict modes(const Mechanism& m, const Array& inertias, const Array& position, const Array& rotation,
               const Array& wrench, const Array& gravity, int count, int threads) {
  const py::ssize_t n = count_of(position), size = m.size();
  const double *p = data(position, {n, 3}, "position"), *R = data(rotation, {n, 3, 3}, "rotation"),
               *w = data(wrench, {n, 6}, "wrench");
  const Vec3 g = Eigen::Map<const Vec3>(data(gravity, {3}, "gravity"));
  const Inertias I = inertias_of(m, inertias);
  auto square = unknown({n, count}), shape = unknown({n, count, size}), x_out = unknown({n, size});
  py::array_t<std::uint8_t> status(n);
  py::array_t<std::uint32_t> flags(n);
  double *ss = square.mutable_data(), *hs = shape.mutable_data(), *xs = x_out.mutable_data();
  std::uint8_t* states = status.mutable_data();
  std::uint32_t* bits = flags.mutable_data();
  {
    py::gil_scoped_release free;
    parallel_chunks(n, 4, threads, [&](int, long begin, long end) {
      SolveWorkspace ws(m);
      ModesResult r;
      PoseInput in;
      in.gravity = g;
      in.load_points = {{m.tip, m.points.front().offset, LoadType::dead}};
      in.read_points = {0};
      for (long i = begin; i < end; ++i) {
        in.commanded = {Eigen::Map<const Vec3>(p + 3 * i), Mat3(Eigen::Map<const Row3>(R + 9 * i))};
        in.wrenches = {Vec6(Eigen::Map<const Vec6>(w + 6 * i))};
        natural_modes(m, I, in, count, ws, r);
        states[i] = static_cast<std::uint8_t>(r.status);
        bits[i] = r.flags;
        Eigen::Map<VecX>(ss + count * i, count) = r.square;
        Eigen::Map<RowX>(hs + count * size * i, count, size) = r.shape.transpose();
        Eigen::Map<VecX>(xs + size * i, size) = r.x;
      }
    });
  }
  py::dict out;
  out["square"] = square;
  out["shape"] = shape;
  out["coordinates"] = x_out;
  out["status"] = status;
  out["flags"] = flags;
  return out;
}

}  // namespace

void bind_measures(py::module_& m) {
  using namespace py::literals;
  py::class_<Mechanism>(m.attr("Mechanism"))
      .def_property_readonly("bodies",
                             [](const Mechanism& k) {
                               std::vector<std::tuple<std::string, Index, double>> out;  // name, node, mass
                               for (const NodeBody& b : k.bodies) out.emplace_back(b.name, b.node, b.mass);
                               return out;
                             })
      .def_property_readonly("limits",
                             [](const Mechanism& k) {
                               std::vector<std::pair<double, double>> out;  // per coordinate
                               for (const Coordinate& c : k.coordinates) out.emplace_back(c.lower, c.upper);
                               return out;
                             })
      .def("kinematics", &kinematics, "position"_a, "rotation"_a, "start"_a, "weights"_a, "rates"_a, "patient"_a,
           "only"_a, "threads"_a)
      .def_readonly("redundancy", &Mechanism::redundancy)
      .def_property_readonly("not_enclosed", &Encloser::missing)
      .def("enclose", &enclose, "centre"_a, "half"_a, "axes"_a, "rotation"_a, "start"_a, "slopes"_a, "watched"_a,
           "threads"_a)
      .def("dynamics", &dynamics, "inertias"_a, "coordinates"_a, "twist"_a, "twist_rate"_a, "wrench"_a, "gravity"_a,
           "rates"_a, "accelerations"_a, "weights"_a, "threads"_a)
      .def("modes", &modes, "inertias"_a, "position"_a, "rotation"_a, "wrench"_a, "gravity"_a, "count"_a, "threads"_a);
}

}  // namespace stiffmap::bindings
