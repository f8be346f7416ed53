// SPDX-License-Identifier: MIT
// Compiled mechanisms and plans: making them, and what they are made of.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "stiffmap/assemble.hpp"
#include "stiffmap/fast_plan.hpp"

namespace stiffmap::bindings {
namespace {

using Nine = std::array<double, 9>;

Nine by_rows(const Mat3& R) {
  Nine out;
  for (int i = 0; i < 9; ++i) out[static_cast<std::size_t>(i)] = R(i / 3, i % 3);
  return out;
}

template <class T, class Get>
std::vector<std::string> names(const std::vector<T>& items, Get get) {
  std::vector<std::string> out;
  for (const T& item : items) out.push_back(get(item));
  return out;
}

using PlainGap = std::tuple<std::string, double, double>;  // name, m, rad

std::vector<PlainGap> gaps(const std::vector<Gap>& of) {
  std::vector<PlainGap> out;
  for (const Gap& g : of) out.emplace_back(g.name, g.translation, g.rotation);
  return out;
}

}  // namespace

void bind_mechanism(py::module_& m) {
  using namespace py::literals;
  py::class_<Mechanism> mechanism(m, "Mechanism");  // before the signatures that name it
  py::class_<FastPlan>(m, "FastPlan")
      .def(py::init([](const Mechanism& k, const Array& low, const Array& high, int grid_nodes) {
             const Vec3 a = Eigen::Map<const Vec3>(data(low, {3}, "low")),
                        b = Eigen::Map<const Vec3>(data(high, {3}, "high"));
             py::gil_scoped_release free;
             return std::make_unique<FastPlan>(k, a, b, grid_nodes);
           }),
           "mechanism"_a, "low"_a, "high"_a, "grid_nodes"_a = 8)
      .def_property_readonly("available", &FastPlan::available)
      .def_property_readonly("missing", &FastPlan::missing);
  // Raised with the words of the core, and the gaps as numbers: (message, declared, closest).
  static const py::handle misfit = py::exception<HomeMisfit>(m, "HomeMisfit", PyExc_ValueError).release();
  py::register_exception_translator([](std::exception_ptr raised) {
    try {
      if (raised) std::rethrow_exception(raised);
    } catch (const HomeMisfit& e) {
      const py::tuple about = py::make_tuple(e.what(), gaps(e.fit.declared), gaps(e.fit.closest));
      PyErr_SetObject(misfit.ptr(), about.ptr());
    }
  });
  m.def(
      "home_gaps",
      [](const Chain& root, const Pose& home, const Task& task, bool search) {
        HomeFit fit;
        assemble(root, home, {}, task, search ? HomeSearch::anywhere : HomeSearch::near, &fit);
        return py::make_tuple(gaps(fit.declared), gaps(fit.closest));
      },
      "root"_a, "home"_a, "task"_a = full_task, "search"_a = false);
  mechanism
      .def(py::init([](const Chain& root, const Pose& home, const std::vector<ExternalSpring>& springs,
                       const Task& task, bool search, const Mechanism* like) {
             return assemble(root, home, springs, task, search ? HomeSearch::anywhere : HomeSearch::near, nullptr,
                             like);
           }),
           "root"_a, "home"_a, "springs"_a, "task"_a = full_task, "search"_a = false, "like"_a = nullptr)
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
      .def_property_readonly("spun_balls",
                             [](const Mechanism& k) {
                               std::vector<std::tuple<Index, Nine, Nine>> out;  // first coordinate, turn, axes
                               for (const SpunBall& b : k.spun_balls)
                                 out.emplace_back(b.first, by_rows(b.turn), by_rows(b.axes));
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
      .def_property_readonly("cables",
                             [](const Mechanism& k) {
                               std::vector<std::string> out;
                               for (const Index i : k.cables) out.push_back(k.external_springs[at(i)].name);
                               return out;
                             })
      .def_property_readonly("legs", [](const Mechanism& k) { return k.legs; })
      .def_readonly("length", &Mechanism::length)
      .def_readonly("stiffness", &Mechanism::stiffness)
      .def("home_coordinates", [](const Mechanism& k) {
        py::array_t<double> out(k.size());
        Eigen::Map<VecX>(out.mutable_data(), k.size()) = k.home_coordinates;
        return out;
      });
}

}  // namespace stiffmap::bindings
