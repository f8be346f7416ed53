// SPDX-License-Identifier: MIT
// One pose, one wrench at the TCP, given as plain numbers: the shortest way from Python to the kernels and
// back. Whatever is not that simple is declined, and the general call checks it and says what is wrong.
#include <array>
#include <cmath>

#include "arrays.hpp"
#include "stiffmap/solve/batch.hpp"

namespace stiffmap::bindings {
namespace {

/// `N` finite numbers of a tuple, list or float64 vector.
template <std::size_t N>
bool read(PyObject* given, std::array<double, N>& out) {
  if (PyTuple_CheckExact(given) || PyList_CheckExact(given)) {
    if (PySequence_Fast_GET_SIZE(given) != static_cast<Py_ssize_t>(N)) return false;
    for (std::size_t i = 0; i < N; ++i) {
      PyObject* item = PySequence_Fast_GET_ITEM(given, static_cast<Py_ssize_t>(i));
      if ((!PyFloat_Check(item) && !PyLong_Check(item)) || PyBool_Check(item)) return false;
      out[i] = PyFloat_AsDouble(item);
      if (PyErr_Occurred()) return PyErr_Clear(), false;
    }
  } else {
    // Exactly an array: a subclass may carry a mask or a unit.
    if (Py_TYPE(given) != py::detail::npy_api::get().PyArray_Type_) return false;
    if (!py::isinstance<py::array_t<double>>(given)) return false;
    const auto a = py::reinterpret_borrow<py::array_t<double>>(given);
    if (a.ndim() != 1 || a.shape(0) != static_cast<py::ssize_t>(N)) return false;
    for (std::size_t i = 0; i < N; ++i) out[i] = a.at(static_cast<py::ssize_t>(i));
  }
  for (const double v : out)
    if (!std::isfinite(v)) return false;
  return true;
}

/// Answer of one pose in one piece of memory; arrays are made when they are asked for.
class OneAnswer {
 public:
  explicit OneAnswer(const Mechanism& m)
      : legs(static_cast<py::ssize_t>(m.legs.size())),
        drives(static_cast<py::ssize_t>(m.drives.size())),
        coordinates(m.size()),
        numbers_(new double[at(6 + 3 * 36 + drives + 6 * legs + coordinates)]),
        open_(new std::uint8_t[at(coordinates)]) {}

  BatchOutput output() {
    BatchOutput o;
    o.displacement = numbers_.get();
    o.stiffness = o.displacement + 6;
    o.compliance = o.stiffness + 36;
    o.free_twists = o.compliance + 36;
    o.effort = o.free_twists + 36;
    o.leg_wrench = o.effort + drives;
    o.coordinates = o.leg_wrench + 6 * legs;
    o.indeterminate = open_.get();
    o.status = &status_;
    o.flags = &flags_;
    o.iterations = &iterations_;
    return o;
  }

  const py::ssize_t legs, drives, coordinates;

 private:
  std::unique_ptr<double[]> numbers_;
  std::unique_ptr<std::uint8_t[]> open_;
  std::uint8_t status_ = 0;
  std::uint32_t flags_ = 0;
  std::int32_t iterations_ = 0;
};

/// A machine and what every such call on it shares.
class OneCall {
 public:
  OneCall(const Mechanism& m, const FastPlan& plan, const Mat3& rotation, const Vec3& gravity)
      : m_(m), plan_(plan), rotation_(rotation) {
    shared_.count = 1;
    shared_.gravity = gravity;
    shared_.read_points = {m.point("tcp")};
    shared_.load_points = {load_at(m, shared_.read_points.front())};
  }

  /// Empty where the call has options that only the general call handles.
  std::unique_ptr<OneAnswer> solve(const py::object& position, const py::object& wrench) const {
    std::array<double, 3> p;
    std::array<double, 6> w{};
    if (!read(position.ptr(), p) || (!wrench.is_none() && !read(wrench.ptr(), w))) return nullptr;
    auto out = std::make_unique<OneAnswer>(m_);
    py::gil_scoped_release free;
    BatchInput in = shared_;
    in.position = p.data();
    in.rotation = rotation_.data();
    in.wrench = w.data();
    solve_batch(m_, &plan_, in, {}, 1, out->output());
    return out;
  }

 private:
  const Mechanism& m_;
  const FastPlan& plan_;
  Row3 rotation_;
  BatchInput shared_;
};

/// The array of one member of BatchOutput, sharing the memory of its answer.
template <class T>
void field(py::class_<OneAnswer>& c, const char* name, T* BatchOutput::* member, Shape (*shape)(const OneAnswer&)) {
  c.def_property_readonly(name, [member, shape](const py::object& self) {
    auto& answer = self.cast<OneAnswer&>();
    return py::array_t<T>(shape(answer), answer.output().*member, self);
  });
}

}  // namespace

void bind_one(py::module_& m) {
  using namespace py::literals;
  py::class_<OneAnswer> answer(m, "OneAnswer");
  const auto scalar = [](const OneAnswer&) { return Shape{1}; };
  const auto six = [](const OneAnswer&) { return Shape{1, 6, 6}; };
  const auto coordinates = [](const OneAnswer& a) { return Shape{1, a.coordinates}; };
  field<double>(answer, "displacement", &BatchOutput::displacement, [](const OneAnswer&) { return Shape{1, 1, 6}; });
  field<double>(answer, "stiffness", &BatchOutput::stiffness, six);
  field<double>(answer, "compliance", &BatchOutput::compliance, six);
  field<double>(answer, "free_twists", &BatchOutput::free_twists, six);
  field<double>(answer, "actuator_effort", &BatchOutput::effort, [](const OneAnswer& a) { return Shape{1, a.drives}; });
  field<double>(answer, "leg_wrench", &BatchOutput::leg_wrench, [](const OneAnswer& a) { return Shape{1, a.legs, 6}; });
  field<double>(answer, "coordinates", &BatchOutput::coordinates, coordinates);
  field<std::uint8_t>(answer, "indeterminate", &BatchOutput::indeterminate, coordinates);
  field<std::uint8_t>(answer, "status", &BatchOutput::status, scalar);
  field<std::uint32_t>(answer, "flags", &BatchOutput::flags, scalar);
  field<std::int32_t>(answer, "iterations", &BatchOutput::iterations, scalar);
  py::class_<OneCall>(m, "OneCall")
      .def(py::init<const Mechanism&, const FastPlan&, const Mat3&, const Vec3&>(), "mechanism"_a, "plan"_a,
           "rotation"_a, "gravity"_a, py::keep_alive<1, 2>(), py::keep_alive<1, 3>())
      .def("solve", &OneCall::solve, "position"_a, "wrench"_a);
}

}  // namespace stiffmap::bindings
