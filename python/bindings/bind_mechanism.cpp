// SPDX-License-Identifier: MIT
// Compiled mechanisms and plans: making them, and what they are made of.
#include "arrays.hpp"
#include "stiffmap/plan/fast_plan.hpp"
#include "stiffmap/solve/assemble.hpp"

namespace stiffmap::bindings {
namespace {

/// The list of one thing of every item that a mechanism has.
template <class Item, class Get>
auto each(std::vector<Item> Mechanism::* items, Get get) {
  return [items, get](const Mechanism& m) {
    std::vector<std::decay_t<std::invoke_result_t<Get, const Item&>>> out;
    for (const Item& item : m.*items) out.push_back(get(item));
    return out;
  };
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
      .def(py::init<const Mechanism&, const Vec3&, const Vec3&, int>(), py::call_guard<py::gil_scoped_release>(),
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
      .def_property_readonly("coordinates", each(&Mechanism::coordinates, [](const Coordinate& c) { return c.name; }))
      .def_property_readonly("roles", each(&Mechanism::coordinates, [](const Coordinate& c) { return int(c.role); }))
      .def_property_readonly("prismatic", each(&Mechanism::coordinates,
                                               [](const Coordinate& c) { return c.type == JointType::prismatic; }))
      .def_property_readonly("locked", each(&Mechanism::coordinates, [](const Coordinate& c) { return c.locked; }))
      .def_property_readonly(
          "limits", each(&Mechanism::coordinates, [](const Coordinate& c) { return std::pair(c.lower, c.upper); }))
      .def_property_readonly("spun_balls", each(&Mechanism::spun_balls,
                                                [](const SpunBall& b) { return std::tuple(b.first, b.turn, b.axes); }))
      .def_property_readonly("springs",
                             each(&Mechanism::groups, [](const SpringGroup& g) { return std::pair(g.name, g.first); }))
      .def_property_readonly("actuators",
                             each(&Mechanism::drives, [](const Drive& d) { return std::pair(d.name, d.coordinate); }))
      .def_property_readonly(
          "bodies", each(&Mechanism::bodies, [](const NodeBody& b) { return std::tuple(b.name, b.node, b.mass); }))
      .def_property_readonly("nodes",
                             each(&Mechanism::nodes, [](const Node& n) { return std::pair(n.parent, n.coordinate); }))
      .def_property_readonly(
          "loops",
          each(&Mechanism::loops, [](const Loop& l) { return std::tuple(l.block, l.branch, l.primary, l.end); }))
      .def_property_readonly("points", each(&Mechanism::points, [](const NodePoint& p) { return p.name; }))
      .def_property_readonly("cables",
                             [](const Mechanism& k) {
                               std::vector<std::string> out;
                               for (const Index i : k.cables) out.push_back(k.external_springs[at(i)].name);
                               return out;
                             })
      .def_readonly("legs", &Mechanism::legs)
      .def_readonly("redundancy", &Mechanism::redundancy)
      .def_readonly("length", &Mechanism::length)
      .def_readonly("stiffness", &Mechanism::stiffness)
      .def("home_coordinates", [](const Mechanism& k) { return k.home_coordinates; });
}

}  // namespace stiffmap::bindings
