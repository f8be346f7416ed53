// SPDX-License-Identifier: MIT
#include "stiffmap/closure/home_record.hpp"

#include <type_traits>

#include "stiffmap/model/whole_branches.hpp"

namespace stiffmap {
namespace {

/// Bytes of what closure sees, one after the other. Springs rest there, bodies and points are no part of the geometry,
/// and names are none.
class Bytes {
 public:
  template <class Value>
  void put(const Value& value) {
    static_assert(std::is_arithmetic_v<Value> || std::is_enum_v<Value>);
    text_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void put(const Vec3& v) { numbers(v.data(), 3); }
  void put(const Pose& pose) {
    put(pose.p);
    numbers(pose.R.data(), 9);
  }
  void put(const Offset& e) { put(e.nominal); }
  void put(const Joint& e) {
    put(e.type);
    put(e.axis);
    put(e.actuated);
    put(e.home);
    put(e.law.has_value());
    put(e.guide_errors.size());
    put(e.ball);
    put(e.lower);
    put(e.upper);
  }
  void put(const Spring&) {}
  void put(const Block& e) {
    put(e.name == "legs");
    put(e.branches.size());
    for (const auto& branch : e.branches) put(branch.second);
  }
  void put(const Chain& chain) {
    for (const auto& element : chain.elements)
      std::visit(
          [&](const auto& e) {
            using Element = std::decay_t<decltype(e)>;
            if constexpr (!std::is_same_v<Element, Body> && !std::is_same_v<Element, Point>) {
              put(static_cast<std::uint8_t>(element.index()));
              put(e);
            }
          },
          element);
    put(end);
  }

  std::string take() && { return std::move(text_); }

 private:
  static constexpr std::uint8_t end = 255;

  void numbers(const double* first, std::size_t count) {
    text_.append(reinterpret_cast<const char*>(first), count * sizeof(double));
  }

  std::string text_;
};

}  // namespace

std::string nominal_geometry(const Chain& root, const Pose& home, const Task& commanded, HomeSearch how) {
  Bytes out;
  out.put(how);
  for (const bool c : commanded) out.put(c);
  out.put(home);
  out.put(root);
  return std::move(out).take();
}

}  // namespace stiffmap
