// SPDX-License-Identifier: MIT
#include "stiffmap/assemble.hpp"

#include <cmath>
#include <optional>

#include "unloaded.hpp"

namespace stiffmap {
namespace {

using namespace unloaded;

constexpr double open_turn = 0.4;     // of a spin, rad or shares of the length
constexpr double open_change = 0.02;  // of the stiffness by it: more than errors of the geometry make

/// A held spin along which the tip's stiffness changes leaves the configuration open (theory K3): not held.
/// `turned`: where each closes when it has turned; what is missing is found and added until one is let go.
void let_go_of_configurations(Mechanism& m, std::vector<VecX>& turned) {
  const NodePoint& tip = m.points.front();
  ClosureWorkspace ws(m);
  std::optional<Unloaded> unloaded;
  Mat6 home;
  std::size_t held = 0;
  bool let_go = false;
  for (Index j = 0; j < m.size(); ++j) {
    Coordinate& c = m.coordinates[at(j)];
    if (!c.locked || c.role != Role::passive) continue;
    if (!unloaded) home = unloaded.emplace(m).stiffness(m.home_coordinates, tip);
    VecX x;
    if (!let_go && held < turned.size()) {
      x = turned[held];
    } else {
      x = m.home_coordinates;
      x[j] += open_turn * m.length / m.unit(j);
      if (close_passive(m, m.home, ws, x) > 1e-9) x.resize(0);
      if (!let_go) turned.push_back(x);
    }
    ++held;
    if (x.size() == 0 || !(change(unloaded->stiffness(x, tip), home) > open_change)) continue;
    c.locked = false;
    let_go = true;
    unloaded.emplace(m);
  }
}

}  // namespace

Mechanism assemble(const Chain& root, const Pose& home, const std::vector<ExternalSpring>& springs, const Task& task,
                   HomeSearch search, HomeFit* fit, const Mechanism* like) {
  const bool known = like && like->record && like->record->holds_for(root, home, task, search);
  HomeRecord record = known ? *like->record : HomeRecord{root, home, task, search, {}, {}, {}, {}, {}};
  Mechanism m(root, home, springs);
  m.task = task;
  std::size_t closing = 0;
  const auto close_it = [&](HomeSearch how) {
    HomeFit found;
    if (known) {
      m.home_coordinates = record.closings[closing].coordinates;
      m.home = record.closings[closing++].home;
      found.closed = true;
    } else {
      found = close_home(m, how);
      record.closings.push_back({m.home_coordinates, m.home});
    }
    return found;
  };
  const HomeFit first = close_it(search);
  if (fit) *fit = first;
  if (!first.closed) throw HomeMisfit(first);
  const auto rebuild = [&](const Chain& chain, const VecX& home_coordinates) {
    Mechanism other(chain, m.home, springs);
    other.task = task;
    other.home_coordinates = home_coordinates;
    m = std::move(other);
    close_it(HomeSearch::near);
  };
  if (!closes_exactly(m)) rebuild(corrected(m), VecX(m.home_coordinates));
  if (!known) record.balls = balls_to_renumber(m);
  if (!record.balls.empty()) {
    VecX x = m.home_coordinates;
    for (const SpunBall& b : record.balls) x.segment<3>(b.first).setZero();
    rebuild(renumbered(m, record.balls), x);
    m.spun_balls = record.balls;
  }
  m.set_rest();
  for (Drive& d : m.drives)
    for (DriveError& e : d.errors)
      if (std::isnan(e.error.reference)) e.error.reference = m.home_coordinates[d.coordinate];
  if (known) {
    for (const Index j : record.locked) m.coordinates[at(j)].locked = true;
    m.beside_home = record.beside_home;
  } else {
    record.locked = lock_spins(m);
    record.beside_home = m.beside_home;
  }
  let_go_of_configurations(m, record.turned);
  m.record = std::make_shared<const HomeRecord>(std::move(record));
  return m;
}

}  // namespace stiffmap
