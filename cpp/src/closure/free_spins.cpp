// SPDX-License-Identifier: MIT
#include "stiffmap/closure/free_spins.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "closing.hpp"

namespace stiffmap {
namespace {

using namespace closing;

constexpr double finite_turn = 0.2;   // rad, or that share of the length
constexpr double far_turn = 2;        // rad, of hinges that lock at home
constexpr double moved_drive = 0.05;  // rad, or that share of the length
constexpr int turned_starts = 24;
constexpr double one_line = 1e-8;        // of the square of a rate: all else turns about one line
constexpr double turns = 1e-4;           // rate of a ball joint in a spin of unit size
constexpr double along = 1e-6;           // 1 - cosine: an axis that is the line but for digits
constexpr double sign_from = 0.3137;     // component that gives a line its direction; no line is short of one
constexpr double far_from_axis = 0.837;  // component beyond which another axis makes the perpendicular

/// Joints that nothing but the closure holds: what a spring resists is no spin.
void select_free(const Mechanism& m, ClosureWorkspace& ws) {
  select_unknowns(m, false, ws);
  const auto sprung = [&](Index j) { return m.coordinates[at(j)].law >= 0; };
  ws.unknown.erase(std::remove_if(ws.unknown.begin(), ws.unknown.end(), sprung), ws.unknown.end());
}

/// Null directions of the closure over the passive coordinates, tip held, at the frames of the last residual.
MatX still_directions(const Mechanism& m, const Target& target, ClosureWorkspace& ws) {
  newton_step(m, target, ws);
  const Index n = ws.A.cols();
  if (n == 0) return MatX(0, 0);
  const Singular svd = singular_vectors(ws.A);
  const Index rank = (svd.values.array() > rank_threshold).count();
  return svd.V.rightCols(n - rank);
}

/// Null directions at closed coordinates `x`, over the joints that may spin.
MatX still_at(const Mechanism& m, ClosureWorkspace& ws, const VecX& x) {
  select_free(m, ws);
  forward(m, Geometry::nominal, x, ws.frames);
  const Pose tip = ws.frames.at(m.tip);
  const Target target{&tip};
  residual(m, x, target, ws);
  return still_directions(m, target, ws);
}

/// A closed place a little way off home, where no axes coincide by chance; false where none was found.
bool off_home(const Mechanism& m, ClosureWorkspace& ws, VecX& x) {
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> share(-1, 1);
  select_unknowns(m, true, ws);
  for (const double way : {0.05, 0.02, 0.1, 0.01, 0.2, 0.3}) {
    x = m.home_coordinates;
    for (const Index j : ws.unknown) x[j] += way * share(random) * m.length / m.unit(j);
    int iterations = 0;
    if (close(m, Target{}, Pace::damped, ws, x, iterations)) return true;
  }
  return false;
}

/// Whether two hinges of a chain, neither of a ball joint, that a null direction turns lie on one line at home.
bool hinges_coincide(const Mechanism& m, const MatX& still, const ClosureWorkspace& ws) {
  Frames home(m);
  forward(m, Geometry::nominal, m.home_coordinates, home);
  std::vector<Index> hinges;
  for (std::size_t k = 0; k < ws.unknown.size(); ++k) {
    const Index j = ws.unknown[k];
    const auto has = [&](const Ball& b) { return j >= b.first && j < b.first + 3; };
    if (m.coordinates[at(j)].type == JointType::revolute && still.row(static_cast<Index>(k)).norm() > turns &&
        std::none_of(m.balls.begin(), m.balls.end(), has))
      hinges.push_back(j);
  }
  for (const Index j : hinges)
    for (const Index before : m.path[at(m.coordinates[at(j)].node)]) {
      if (before == j || std::find(hinges.begin(), hinges.end(), before) == hinges.end()) continue;
      const Vec3 axis = home.axis.col(j), arm = home.origin.col(j) - home.origin.col(before);
      if (axis.cross(home.axis.col(before)).norm() < along && axis.cross(arm).norm() < along * m.length) return true;
    }
  return false;
}

/// The same where hinges lock at home: least squares would close the loops by going back into the lock. So drives are
/// moved and held, and the hinges start far turned.
bool off_lock(const Mechanism& m, const MatX& still, ClosureWorkspace& ws, VecX& x, MatX& out) {
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> share(-1, 1);
  for (int start = 0; start < turned_starts; ++start) {
    x = m.home_coordinates;
    select_free(m, ws);
    for (Index c = 0; c < still.cols(); ++c) {
      const double by = far_turn * share(random) / still.col(c).cwiseAbs().maxCoeff();
      for (std::size_t k = 0; k < ws.unknown.size(); ++k)
        x[ws.unknown[k]] += by * still(static_cast<Index>(k), c) * m.length / m.unit(ws.unknown[k]);
    }
    select_unknowns(m, true, ws);
    for (const Index j : ws.unknown) x[j] += moved_drive * share(random) * m.length / m.unit(j);
    select_unknowns(m, false, ws);
    int iterations = 0;
    if (!close(m, Target{}, Pace::damped, ws, x, iterations)) continue;
    out = still_at(m, ws, x);
    if (out.cols() < still.cols()) return true;
  }
  return false;
}

/// Null directions at home over `ws.unknown`, those nearest to the spins elsewhere where axes coincide at home only;
/// there `beside` is a place where they do not.
MatX spins_at_home(const Mechanism& m, ClosureWorkspace& ws, VecX& beside) {
  beside.resize(0);
  select_free(m, ws);
  const Target target{&m.home};
  residual(m, m.home_coordinates, target, ws);
  const MatX still = still_directions(m, target, ws);
  if (still.cols() == 0) return still;
  VecX x;
  MatX there = still;
  if (off_home(m, ws, x)) there = still_at(m, ws, x);
  select_free(m, ws);
  if (there.cols() >= still.cols() && !(hinges_coincide(m, still, ws) && off_lock(m, still, ws, x, there))) {
    select_free(m, ws);
    return still;
  }
  select_free(m, ws);
  beside = x;
  MatX out = still * (still.transpose() * there);
  out.colwise().normalize();
  return out;
}

/// Whether a null direction at home is a finite motion: with one coordinate held elsewhere the others close again.
bool goes_on(Mechanism& m, const Target& target, const VecX& direction, Index coordinate, ClosureWorkspace& ws) {
  VecX x = m.home_coordinates;
  for (std::size_t k = 0; k < ws.unknown.size(); ++k)
    x[ws.unknown[k]] += finite_turn * m.length / m.unit(ws.unknown[k]) * direction[static_cast<Index>(k)];
  bool& locked = m.coordinates[at(coordinate)].locked;
  locked = true;
  select_free(m, ws);
  int iterations = 0;
  const bool ok = close(m, target, Pace::damped, ws, x, iterations) && residual(m, x, target, ws) < round_off;
  locked = false;
  select_free(m, ws);
  return ok;
}

/// Sizes of a spin's coordinates; the middle one of a ball joint counts little: it turns back before the spin has gone
/// round.
VecX winding(const Mechanism& m, const VecX& spin, const ClosureWorkspace& ws) {
  VecX out = spin.cwiseAbs();
  for (const Ball& b : m.balls)
    for (std::size_t k = 0; k < ws.unknown.size(); ++k)
      if (ws.unknown[k] == b.first + 1) out[static_cast<Index>(k)] *= 0.2;
  return out;
}

/// Angular velocities at home (columns: spins) by the coordinates that `takes` chooses.
template <class Takes>
MatX turning(const Mechanism& m, const Frames& home, const MatX& spins, const std::vector<Index>& unknown,
             Takes&& takes) {
  MatX out = MatX::Zero(3, spins.cols());
  for (std::size_t k = 0; k < unknown.size(); ++k) {
    const Index j = unknown[k];
    if (m.coordinates[at(j)].type != JointType::revolute || !takes(j)) continue;
    out += home.axis.col(j) * spins.row(static_cast<Index>(k));
  }
  return out;
}

/// Three perpendicular axes of which `line` is the first or the last; small changes of the line change them little.
Mat3 around(Vec3 line, bool last) {
  for (int i = 0; i < 3; ++i) {
    if (std::abs(line[i]) < sign_from) continue;
    if (line[i] < 0) line = -line;
    break;
  }
  const Vec3 aside = line.cross(std::abs(line.x()) < far_from_axis ? Vec3::UnitX() : Vec3::UnitY()).normalized();
  Mat3 out;
  if (last) out << aside.cross(line), aside, line;
  else out << line, aside, line.cross(aside);
  return out;
}

/// Puts axes and turns into the chain, in the order in which Mechanism numbered the coordinates.
class Renumbering {
 public:
  explicit Renumbering(const std::vector<SpunBall>& balls) : balls_(balls) {}

  void chain(Chain& c) {
    const auto elements = std::move(c.elements);
    c.elements.clear();
    for (auto element : elements) {
      if (Block* block = std::get_if<Block>(&element))
        for (auto& branch : block->branches) chain(branch.second);
      else if (std::holds_alternative<Spring>(element)) next_ += 6;
      else if (Joint* one = std::get_if<Joint>(&element)) joint(*one, c);
      c.elements.push_back(element);
    }
  }

 private:
  void joint(Joint& joint, Chain& before) {
    for (const SpunBall& b : balls_) {
      const Index k = next_ - b.first;
      if (k == 0) {
        const Pose turn{Vec3::Zero(), b.turn};
        before.elements.emplace_back(Offset{joint.name + ".line", turn, turn});
      }
      if (k < 0 || k > 2) continue;
      joint.axis = b.axes.col(k);
      joint.home = 0;
    }
    next_ += 1 + static_cast<Index>(joint.guide_errors.size());
  }

  const std::vector<SpunBall>& balls_;
  Index next_ = 0;
};

}  // namespace

/// A spin moves passive coordinates and nothing that the closure sees, at home as anywhere: its null
/// direction is the tangent of a finite motion, and has its like off home (axes that coincide at home only
/// have not: a gimbal lock). One coordinate of it is held.
std::vector<Index> lock_spins(Mechanism& m) {
  std::vector<Index> out;
  ClosureWorkspace ws(m);
  const Target target{&m.home};
  for (;;) {
    const MatX spins = spins_at_home(m, ws, m.beside_home);
    if (spins.cols() == 0) return out;
    const VecX spin = spins.rightCols<1>();
    Index held = 0;
    winding(m, spin, ws).maxCoeff(&held);
    if (!goes_on(m, target, spin / spin[held], ws.unknown[at(held)], ws)) return out;  // singular at home, but no spin
    out.push_back(ws.unknown[at(held)]);
    m.coordinates[at(out.back())].locked = true;
  }
}

std::vector<SpunBall> balls_to_renumber(const Mechanism& m) {
  std::vector<SpunBall> out;
  if (std::none_of(m.balls.begin(), m.balls.end(), [](const Ball& b) { return b.free; })) return out;
  ClosureWorkspace ws(m);
  VecX beside;
  const MatX spins = spins_at_home(m, ws, beside);
  if (spins.cols() == 0) return out;
  Frames home(m);
  forward(m, Geometry::nominal, m.home_coordinates, home);
  for (const Ball& b : m.balls) {
    if (!b.free) continue;
    const auto own = [&](Index j) { return j >= b.first && j < b.first + 3; };
    const MatX turn = turning(m, home, spins, ws.unknown, own);
    const EigenX rates = symmetric_eigen(MatX(turn * turn.transpose()));  // rising
    if (rates.values[2] < turns * turns || rates.values[1] > one_line * rates.values[2]) continue;
    const Vec3 line = rates.vectors.col(2);
    const Index first = m.coordinates[at(b.first)].node, last = m.coordinates[at(b.first + 2)].node;
    const std::vector<Index>& way = m.path[at(m.nodes[at(first)].parent)];
    const MatX before =
        turning(m, home, spins, ws.unknown, [&](Index j) { return std::find(way.begin(), way.end(), j) != way.end(); });
    const bool beyond = (line.transpose() * before).norm() < (line.transpose() * (before + turn)).norm();
    if (std::abs(line.dot(home.axis.col(beyond ? b.first + 2 : b.first))) > 1 - along) continue;
    const Mat3 &root = home.at(m.nodes[at(first)].parent).R, &end = home.at(last).R;
    out.push_back({b.first, root.transpose() * end, around(end.transpose() * line, beyond)});
  }
  return out;
}

Chain renumbered(const Mechanism& m, const std::vector<SpunBall>& balls) {
  Chain out = m.description;
  Renumbering(balls).chain(out);
  return out;
}

}  // namespace stiffmap
