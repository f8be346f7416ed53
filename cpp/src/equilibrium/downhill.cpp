// SPDX-License-Identifier: MIT
#include "downhill.hpp"

#include <cmath>
#include <limits>

namespace stiffmap {
namespace {

constexpr int most_down = 150, line_trials = 6;
constexpr double longest = 0.1;               // of a step, in multiples of the length
constexpr double first_shift = 1e-4;          // added stiffness, in multiples of the machine's
constexpr double more = 4, most_shift = 100;  // its growth, and where it ends
constexpr double flattened = 0.1;             // slope of the energy at the end of a step, of that at its start
constexpr double same_force = 1e-15;          // a step that changes no force

class Downhill {
 public:
  Downhill(const Mechanism& m, const Problem& p, EquilibriumWorkspace& ws, State& state)
      : m_(m), p_(p), ws_(ws), state_(state), from_(state) {}

  bool run(double tolerance, int& iterations) {
    double previous = std::numeric_limits<double>::infinity();
    for (int k = 0; k < most_down; ++k, ++iterations) {
      off_locks(m_, p_, state_);
      linearize(m_, p_, state_, ws_.lin);
      if (!rising_tangent()) return false;
      force_balance(m_, ws_.lin, ws_.saddle, ws_.force);
      ws_.saddle.solve(ws_.force, ws_.lin.e, ws_.dz, ws_.dlambda);
      const double norm = ws_.saddle.step_norm(m_, ws_.dz);
      if (!std::isfinite(norm)) return false;
      if (shift_ == 0 && norm < tolerance && (norm < same_force || previous < tolerance)) {
        state_.z += ws_.dz;
        state_.lambda += ws_.dlambda;
        return true;
      }
      if (shift_ > 0 && norm < tolerance) return false;  // a saddle point, or something moves freely
      previous = shift_ == 0 ? norm : std::numeric_limits<double>::infinity();
      take(std::min(1.0, longest / norm));
    }
    return false;
  }

 private:
  const Mechanism& m_;
  const Problem& p_;
  EquilibriumWorkspace& ws_;
  State& state_;
  State from_;             ///< where the present step starts
  VecX deflection_, way_;  ///< of all coordinates there, and by the whole step
  double shift_ = 0;
  bool redundant_ = false;  ///< closures depend on each other: no added stiffness makes the tangent regular

  /// The tangent, stiffened until its energy rises along every closed motion.
  bool rising_tangent() {
    shift_ = 0;
    for (;;) {
      ws_.saddle.assemble(m_, ws_.lin);
      if (shift_ > 0) ws_.saddle.stiffen(shift_);
      ws_.saddle.factorize();
      const bool open = !ws_.saddle.regular() && !redundant_;
      if (open && shift_ > 0) redundant_ = true;
      if (ws_.stability.falling(ws_.saddle) == 0 && (!open || redundant_)) return true;
      shift_ = shift_ == 0 ? first_shift : more * shift_;
      if (shift_ > most_shift) return false;
    }
  }

  bool by_deflection(Index j) const {
    const Coordinate& c = m_.coordinates[at(j)];
    return !c.locked && c.law >= 0 && m_.laws[at(c.law)].has_knots() && !m_.laws[at(c.law)].sticks();
  }

  void stand(double share) {
    state_.z = from_.z + share * ws_.dz;
    for (Index j = 0; j < m_.size(); ++j)
      if (by_deflection(j))
        state_.z[j] =
            m_.laws[at(m_.coordinates[at(j)].law)].from_deflection(deflection_[j] + share * way_[j], p_.drive_scale[j]);
  }

  /// Derivative of the energy by the share of the step, closures held by the wrenches that the whole step leads to.
  double slope(double share) {
    stand(share);
    state_.lambda = from_.lambda + ws_.dlambda;
    linearize(m_, p_, state_, ws_.lin);
    double out = 0;
    for (Index j = 0; j < m_.size(); ++j)
      if (ws_.lin.kind[at(j)] != Kind::fixed)
        out += ws_.lin.r[j] * (by_deflection(j) ? way_[j] : ws_.lin.da[j] * ws_.dz[j]);
    return out;
  }

  /// Goes at most the share `most` of the step, no farther than the energy falls.
  void take(double most) {
    from_ = state_;
    deflection_ = ws_.lin.x - p_.base;
    way_ = ws_.lin.da.cwiseProduct(ws_.dz);
    const double start = slope(0);
    double share = most, end = slope(most);
    if (start < 0 && end > -flattened * start) {  // Illinois: a false position that does not stay on one side
      double low = 0, high = most, at_low = start, at_high = end;
      for (int k = 0; k < line_trials && std::abs(end) > -flattened * start; ++k) {
        share = low - at_low * (high - low) / (at_high - at_low);
        end = slope(share);
        if (end > 0) {
          high = share;
          at_high = end;
          at_low *= 0.5;
        } else {
          low = share;
          at_low = end;
          at_high *= 0.5;
        }
      }
    }
    stand(share);
    state_.lambda = from_.lambda + share * ws_.dlambda;
  }
};

}  // namespace

bool settle_downhill(const Mechanism& m, const Problem& p, double tolerance, EquilibriumWorkspace& ws, State& state,
                     EquilibriumResult& out) {
  return Downhill(m, p, ws, state).run(tolerance, out.iterations);
}

}  // namespace stiffmap
