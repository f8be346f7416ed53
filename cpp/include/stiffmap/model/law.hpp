// SPDX-License-Identifier: MIT
// Force law of one coordinate, as a monotone graph traced by one parameter.
#pragma once

#include <utility>
#include <vector>

namespace stiffmap {

/// A point of the graph and its tangent: deflection a(z), force tau(z), da/dz, dtau/dz >= 0.
/// da = 0: stuck (rigid); dtau = 0: free; otherwise the stiffness is dtau / da.
struct LawPoint {
  double a, tau, da, dtau;
};

/// Linear with an optional cubic term (z = (a + tau / stiffness) / 2), or a monotone polyline (z = a + tau /
/// stiffness). Both coordinates are then Lipschitz in z (theory L1): a step is an ordinary point, whether force or
/// deflection is given.
class Law {
 public:
  explicit Law(double stiffness, double cubic = 0.0, std::vector<std::pair<double, double>> knots = {},
               double friction = 0.0);

  /// The point at z for a drive whose compliance is `scale` times the declared one.
  LawPoint at(double z, double scale = 1.0) const;

  /// Parameter of the point that carries force tau: the start of a Newton iteration.
  double from_force(double tau, double scale = 1.0) const;

  /// Parameter at deflection a, of a law that does not stick.
  double from_deflection(double a, double scale = 1.0) const;

  bool linear() const { return cubic_ == 0.0 && knots_.empty() && friction_ == 0.0; }
  bool has_knots() const { return !knots_.empty(); }
  /// Holds a range of forces at one deflection.
  bool sticks() const;
  double stiffness() const { return stiffness_; }
  double cubic() const { return cubic_; }
  /// Constant force against the deflection that the load would give without it: docs/effects.md.
  double friction() const { return friction_; }
  const std::vector<std::pair<double, double>>& knots() const { return knots_; }

 private:
  double stiffness_, cubic_, friction_;
  std::vector<std::pair<double, double>> knots_;  // (a, tau)
  std::vector<double> z_;
};

}  // namespace stiffmap
