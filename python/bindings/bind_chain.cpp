// SPDX-License-Identifier: MIT
// Elements of chains, in the order of their members.
#include "arrays.hpp"
#include "stiffmap/model/chain.hpp"

namespace stiffmap::bindings {
namespace {

using Text = const std::string&;
using Table = std::vector<std::pair<double, double>>;
using Errors = std::vector<CommandError>;

DriveNumbers drive_numbers_of(const py::dict& given) {
  DriveNumbers out;
  std::size_t known = 0;
  for (const DriveNumber& n : drive_numbers)
    if (given.contains(n.name)) {
      out.*n.value = given[n.name].cast<double>();
      ++known;
    }
  if (known != given.size()) throw py::key_error("a number that the core's drives do not have");
  return out;
}

template <class Element, class... Members>
void add(Chain& c, Members... members) {
  c.elements.emplace_back(Element{std::move(members)...});
}

void add_joint(Chain& c, Text name, bool prismatic, const Vec3& axis, bool actuated, double home,
               const std::optional<Law>& law, const py::dict& numbers, const Errors& errors, double lower, double upper,
               const std::vector<std::pair<Vec3, CommandError>>& guide, double friction, bool about_command,
               std::optional<double> rest, Text ball) {
  std::vector<GuideError> across;
  for (const auto& [direction, error] : guide) across.push_back({direction, error});
  const BallChart chart = ball.empty() ? BallChart::none : ball == "free" ? BallChart::free : BallChart::meant;
  add<Joint>(c, name, prismatic ? JointType::prismatic : JointType::revolute, axis, actuated, home, law,
             drive_numbers_of(numbers), errors, across, friction, about_command, rest, chart, lower, upper);
}

void add_spring(Chain& c, Text name, const Mat6& matrix, bool compliance, const Vec6& rest,
                const std::vector<std::pair<int, Law>>& laws, const std::optional<Stroke>& stroke) {
  add<Spring>(c, name, compliance ? spring_from_compliance(matrix, name) : spring_from_stiffness(matrix, name), rest,
              laws, stroke);
}

}  // namespace

void bind_chain(py::module_& m) {
  using namespace py::literals;
  py::list names;
  for (const DriveNumber& n : drive_numbers) names.append(n.name);
  m.attr("DRIVE_NUMBERS") = py::tuple(names);
  py::class_<Pose>(m, "Pose").def(py::init<Vec3, Mat3>(), "translation"_a, "rotation"_a);
  py::class_<Law>(m, "Law").def(py::init<double, double, Table, double>(), "stiffness"_a, "cubic"_a, "knots"_a,
                                "friction"_a = 0.0);
  py::class_<CommandError>(m, "CommandError")
      .def(py::init<std::string, double, double, double, double, double, double, Table>(), "of"_a, "offset"_a,
           "slope"_a, "amplitude"_a, "period"_a, "phase"_a, "reference"_a, "knots"_a);
  py::class_<Stroke>(m, "Stroke")
      .def(py::init<std::string, int, double, double, double, std::vector<std::pair<double, Mat6>>>(), "joint"_a,
           "along"_a, "at"_a, "length"_a, "rate"_a, "table"_a);
  py::class_<Chain>(m, "Chain")
      .def(py::init<>())
      .def("offset", &add<Offset, std::string, Pose, Pose>, "name"_a, "nominal"_a, "actual"_a)
      .def("joint", &add_joint, "name"_a, "prismatic"_a, "axis"_a, "actuated"_a, "home"_a, "law"_a, "numbers"_a,
           "errors"_a, "lower"_a, "upper"_a, "guide_errors"_a, "friction"_a, "about_command"_a, "rest"_a = std::nullopt,
           "ball"_a = "")
      .def("spring", &add_spring, "name"_a, "matrix"_a, "compliance"_a, "rest"_a, "laws"_a, "stroke"_a = std::nullopt)
      .def("body", &add<Body, std::string, double, Vec3>, "name"_a, "mass"_a, "com"_a)
      .def("point", &add<Point, std::string, Vec3>, "name"_a, "offset"_a)
      .def("block", &add<Block, std::string, std::vector<std::pair<std::string, Chain>>>, "name"_a, "branches"_a);
  py::class_<Winch>(m, "Winch")
      .def(py::init([](double elasticity, double lead, double pretension, double factor, double lead_factor,
                       double radius, const Vec3& axis, const Vec3& anchor_error, const Vec3& point_error, double lower,
                       double upper, const py::dict& numbers, const Errors& errors) {
             return Winch{elasticity, lead,         pretension,  factor, lead_factor, radius,
                          axis,       anchor_error, point_error, lower,  upper,       drive_numbers_of(numbers),
                          errors};
           }),
           "elasticity"_a, "lead"_a, "pretension"_a, "factor"_a, "lead_factor"_a, "radius"_a, "axis"_a,
           "anchor_error"_a, "point_error"_a, "lower"_a, "upper"_a, "numbers"_a, "errors"_a);
  py::class_<ExternalSpring>(m, "ExternalSpring")
      .def(py::init<std::string, std::string, Vec3, double, double, bool, std::optional<Winch>>(), "name"_a, "point"_a,
           "anchor"_a, "stiffness"_a, "length"_a, "tension_only"_a, "winch"_a = std::nullopt);
}

}  // namespace stiffmap::bindings
