// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "stiffmap/chain.hpp"

namespace stiffmap::bindings {
namespace {

Mat6 mat6(const Array& a, const char* name) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(data(a, {6, 6}, name));
}

Pose make_pose(const Array& p, const Array& R) { return {vec3(p, "translation"), mat3(R, "rotation")}; }

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

}  // namespace

void bind_chain(py::module_& m) {
  using namespace py::literals;
  py::list names;
  for (const DriveNumber& n : drive_numbers) names.append(n.name);
  m.attr("DRIVE_NUMBERS") = py::tuple(names);
  py::class_<Pose>(m, "Pose").def(py::init(&make_pose), "translation"_a, "rotation"_a);
  py::class_<Law>(m, "Law").def(py::init<double, double, std::vector<std::pair<double, double>>, double>(),
                                "stiffness"_a, "cubic"_a, "knots"_a, "friction"_a = 0.0);
  py::class_<CommandError>(m, "CommandError")
      .def(py::init([](double offset, double slope, double amplitude, double period, double phase, double reference,
                       std::vector<std::pair<double, double>> knots) {
             return CommandError{offset, slope, amplitude, period, phase, reference, std::move(knots)};
           }),
           "offset"_a, "slope"_a, "amplitude"_a, "period"_a, "phase"_a, "reference"_a, "knots"_a);
  py::class_<Stroke>(m, "Stroke")
      .def(py::init([](const std::string& joint, int along, double at, double length, double rate,
                       const std::vector<std::pair<double, Array>>& table) {
             Stroke out{joint, along, at, length, rate, {}};
             for (const auto& [u, compliance] : table) out.table.emplace_back(u, mat6(compliance, "stroke"));
             return out;
           }),
           "joint"_a, "along"_a, "at"_a, "length"_a, "rate"_a, "table"_a);
  py::class_<Chain>(m, "Chain")
      .def(py::init<>())
      .def(
          "offset",
          [](Chain& c, const std::string& name, const Pose& nominal, const Pose& actual) {
            c.elements.emplace_back(Offset{name, nominal, actual});
          },
          "name"_a, "nominal"_a, "actual"_a)
      .def(
          "joint",
          [](Chain& c, const std::string& name, bool prismatic, const Array& axis, bool actuated, double home,
             const std::optional<Law>& law, const py::dict& numbers, const std::vector<CommandError>& errors,
             double lower, double upper, const std::vector<std::pair<Array, CommandError>>& guide, double friction,
             bool about_command, std::optional<double> rest, const std::string& ball) {
            std::vector<GuideError> across;
            for (const auto& [direction, error] : guide) across.push_back({vec3(direction, "axis"), error});
            c.elements.emplace_back(Joint{name, prismatic ? JointType::prismatic : JointType::revolute,
                                          vec3(axis, "axis"), actuated, home, law, drive_numbers_of(numbers), errors,
                                          across, friction, about_command, rest,
                                          ball.empty()     ? BallChart::none
                                          : ball == "free" ? BallChart::free
                                                           : BallChart::meant,
                                          lower, upper});
          },
          "name"_a, "prismatic"_a, "axis"_a, "actuated"_a, "home"_a, "law"_a, "numbers"_a, "errors"_a, "lower"_a,
          "upper"_a, "guide_errors"_a, "friction"_a, "about_command"_a, "rest"_a = std::nullopt, "ball"_a = "")
      .def(
          "spring",
          [](Chain& c, const std::string& name, const Array& matrix, bool compliance, const Array& rest,
             const std::vector<std::pair<int, Law>>& laws, const std::optional<Stroke>& stroke) {
            const Mat6 M = mat6(matrix, "spring");
            c.elements.emplace_back(
                Spring{name, compliance ? spring_from_compliance(M, name) : spring_from_stiffness(M, name),
                       Eigen::Map<const Vec6>(data(rest, {6}, "rest")), laws, stroke});
          },
          "name"_a, "matrix"_a, "compliance"_a, "rest"_a, "laws"_a, "stroke"_a = std::nullopt)
      .def(
          "body",
          [](Chain& c, const std::string& name, double mass, const Array& com) {
            c.elements.emplace_back(Body{name, mass, vec3(com, "com")});
          },
          "name"_a, "mass"_a, "com"_a)
      .def(
          "point",
          [](Chain& c, const std::string& name, const Array& offset) {
            c.elements.emplace_back(Point{name, vec3(offset, "offset")});
          },
          "name"_a, "offset"_a)
      .def(
          "block",
          [](Chain& c, const std::string& name, const std::vector<std::pair<std::string, Chain>>& branches) {
            c.elements.emplace_back(Block{name, branches});
          },
          "name"_a, "branches"_a);
  py::class_<Winch>(m, "Winch")
      .def(py::init([](double elasticity, double lead, double pretension, double factor, double lead_factor,
                       double radius, const Array& axis, const Array& anchor_error, const Array& point_error,
                       double lower, double upper, const py::dict& numbers, const std::vector<CommandError>& errors) {
             return Winch{elasticity,
                          lead,
                          pretension,
                          factor,
                          lead_factor,
                          radius,
                          vec3(axis, "axis"),
                          vec3(anchor_error, "anchor_error"),
                          vec3(point_error, "point_error"),
                          lower,
                          upper,
                          drive_numbers_of(numbers),
                          errors};
           }),
           "elasticity"_a, "lead"_a, "pretension"_a, "factor"_a, "lead_factor"_a, "radius"_a, "axis"_a,
           "anchor_error"_a, "point_error"_a, "lower"_a, "upper"_a, "numbers"_a, "errors"_a);
  py::class_<ExternalSpring>(m, "ExternalSpring")
      .def(py::init([](const std::string& name, const std::string& point, const Array& anchor, double stiffness,
                       double length, bool tension_only, const std::optional<Winch>& winch) {
             return ExternalSpring{name, point, vec3(anchor, "anchor"), stiffness, length, tension_only, winch};
           }),
           "name"_a, "point"_a, "anchor"_a, "stiffness"_a, "length"_a, "tension_only"_a, "winch"_a = std::nullopt);
}

}  // namespace stiffmap::bindings
