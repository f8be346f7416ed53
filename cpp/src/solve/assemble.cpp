// SPDX-License-Identifier: MIT
#include "stiffmap/solve/assemble.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "stiffmap/closure/redundancy.hpp"
#include "unloaded.hpp"

namespace stiffmap {
namespace {

using namespace unloaded;

constexpr double open_turn = 0.4;     // of a spin, rad or shares of the length
constexpr double open_change = 0.02;  // of the stiffness by it: more than errors of the geometry make
constexpr double no_change = 1e-6;    // of it by nothing but round-off
constexpr std::size_t kept = 128;     // records of machines made like each other

/// The mechanism without errors, with springs and laws that have nothing in common with each other: a motion that does
/// not change its stiffness changes it for no springs and laws, since stiffness is a rational function of them.
Mechanism with_any_springs(const Mechanism& m) {
  Mechanism out = m;
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> share(-1, 1);
  for (Node& n : out.nodes) n.actual = n.nominal;
  for (Drive& d : out.drives) {
    d.numbers = {};
    d.errors.clear();
  }
  Vec6 unit;
  unit << Vec3::Ones(), Vec3::Constant(m.length);
  for (SpringGroup& g : out.groups) {
    const Mat6 any = Mat6::NullaryExpr([&] { return share(random); });
    g.matrix = {};
    g.matrix.stiffness =
        m.stiffness * unit.asDiagonal() * (any * any.transpose() + Mat6::Identity()) * unit.asDiagonal();
    g.rest.setZero();
    g.stroke.reset();
    for (Index k = 0; k < 6; ++k) out.coordinates[at(g.first + k)].law = -1;
  }
  for (Index j = 0; j < out.size(); ++j)
    if (const Index law = out.coordinates[at(j)].law; law >= 0)
      out.laws[at(law)] = Law(m.stiffness * m.unit(j) * m.unit(j) * (1.5 + share(random)));
  out.external_springs.clear();
  out.cables.clear();
  return out;
}

/// Whether what a settled spin says holds here: a cable may be fixed to the rod, a spring vary with a joint that turns.
bool takes_springs_along(const Mechanism& m, const VecX& x) {
  return m.external_springs.empty() && std::all_of(m.groups.begin(), m.groups.end(), [&](const SpringGroup& g) {
           return !g.stroke || std::abs(x[g.varies_with] - m.home_coordinates[g.varies_with]) < 1e-9 * m.length;
         });
}

/// Stiffnesses of the tip where spins have turned, against the one at home; nothing is computed before it is asked for.
class Turns {
 public:
  explicit Turns(const Mechanism& m) : m_(m), tip_(m.points.front()) {}

  double change_at(const VecX& x) {
    if (!unloaded_) home_ = unloaded_.emplace(m_).stiffness(m_.home_coordinates, tip_);
    return change(unloaded_->stiffness(x, tip_), home_);
  }

  /// The mechanism holds fewer spins than before; what they change still counts from where all were held.
  void renew() { unloaded_.emplace(m_); }

 private:
  const Mechanism& m_;
  const NodePoint& tip_;
  std::optional<Unloaded> unloaded_;
  Mat6 home_;
};

/// A held spin along which the tip's stiffness changes leaves the configuration open (theory K3): not held.
/// `turned`: what is missing is found and added until one is let go.
void let_go_of_configurations(Mechanism& m, std::vector<HomeRecord::Turned>& turned) {
  ClosureWorkspace ws(m);
  Turns own(m);
  std::optional<Mechanism> of_any;
  std::optional<Turns> any;
  std::size_t held = 0;
  bool let_go = false;
  for (Index j = 0; j < m.size(); ++j) {
    Coordinate& c = m.coordinates[at(j)];
    if (!c.locked || c.role != Role::passive) continue;
    HomeRecord::Turned turn;
    if (!let_go && held < turned.size()) {
      turn = turned[held];
    } else {
      VecX& x = turn.coordinates;
      x = m.home_coordinates;
      x[j] += open_turn * m.length / m.unit(j);
      if (close_passive(m, m.home, ws, x) > 1e-9) x.resize(0);
      if (!let_go && x.size() != 0) {
        if (!any) any.emplace(of_any.emplace(with_any_springs(m)));
        turn.settled = any->change_at(x) < no_change;
      }
      if (!let_go) turned.push_back(turn);
    }
    ++held;
    const VecX& x = turn.coordinates;
    if (x.size() == 0 || (turn.settled && takes_springs_along(m, x)) || !(own.change_at(x) > open_change)) continue;
    c.locked = false;
    let_go = true;
    own.renew();
  }
}

/// One assembly. It finds out what stands in a record, or takes it from one that is known.
class Assembly {
 public:
  Assembly(const Chain& root, const Pose& home, const std::vector<ExternalSpring>& springs, const Task& task,
           const HomeRecord* known = nullptr)
      : springs_(springs), known_(known), m_(root, home, springs) {
    m_.task = task;
  }

  Mechanism run(HomeSearch search, HomeFit* fit) {
    const HomeFit first = close(search);
    if (fit) *fit = first;
    if (!first.closed) throw HomeMisfit(first);
    if (!closes_exactly(m_)) rebuild(corrected(m_), VecX(m_.home_coordinates));
    found.balls = known_ ? known_->balls : balls_to_renumber(m_);
    if (!found.balls.empty()) {
      VecX x = m_.home_coordinates;
      for (const SpunBall& b : found.balls) x.segment<3>(b.first).setZero();
      rebuild(renumbered(m_, found.balls), x);
      m_.spun_balls = found.balls;
    }
    m_.set_rest();
    for (Drive& d : m_.drives)
      for (DriveError& e : d.errors)
        if (std::isnan(e.error.reference)) e.error.reference = m_.home_coordinates[e.of];
    if (known_) {
      for (const Index j : known_->locked) m_.coordinates[at(j)].locked = true;
      m_.beside_home = known_->beside_home;
    } else {
      found.locked = lock_spins(m_);
      found.beside_home = m_.beside_home;
    }
    if (known_) found.turned = known_->turned;
    let_go_of_configurations(m_, found.turned);
    find_redundancy(m_);
    return std::move(m_);
  }

  HomeRecord found;

 private:
  HomeFit close(HomeSearch how) {
    HomeFit out;
    if (known_) {
      const HomeRecord::Closing& closing = known_->closings[closings_++];
      m_.home_coordinates = closing.coordinates;
      m_.home = closing.home;
      out.closed = true;
    } else {
      out = close_home(m_, how);
      found.closings.push_back({m_.home_coordinates, m_.home});
    }
    return out;
  }

  void rebuild(const Chain& chain, const VecX& home_coordinates) {
    Mechanism other(chain, m_.home, springs_);
    other.task = m_.task;
    other.home_coordinates = home_coordinates;
    m_ = std::move(other);
    close(HomeSearch::near);
  }

  const std::vector<ExternalSpring>& springs_;
  const HomeRecord* known_;
  Mechanism m_;
  std::size_t closings_ = 0;
};

}  // namespace

Mechanism assemble(const Chain& root, const Pose& home, const std::vector<ExternalSpring>& springs, const Task& task,
                   HomeSearch search, HomeFit* fit, const Mechanism* like) {
  std::shared_ptr<HomeRecords> records = like && like->records ? like->records : std::make_shared<HomeRecords>(kept);
  std::optional<Mechanism> made;
  const auto record = records->get(nominal_geometry(root, home, task, search), [&] {
    Assembly first(root, home, springs, task);
    made = first.run(search, fit);
    return std::make_shared<const HomeRecord>(std::move(first.found));
  });
  if (!made) made = Assembly(root, home, springs, task, record.get()).run(search, fit);
  made->records = std::move(records);
  return *std::move(made);
}

}  // namespace stiffmap
