// SPDX-License-Identifier: MIT
#include "stiffmap/closure/home.hpp"

#include <algorithm>
#include <numbers>
#include <random>
#include <sstream>

#include "closing.hpp"
#include "stiffmap/kinematics/pull.hpp"

namespace stiffmap {
namespace {

using namespace closing;

constexpr double near_enough = 0.05;  // declared coordinates, relative to the length
constexpr int most_starts = 200;      // of a search

std::vector<Gap> gaps(const Mechanism& m, const VecX& x, const Target& target, ClosureWorkspace& ws) {
  forward(m, Geometry::nominal, x, ws.frames);
  std::vector<Gap> out;
  const auto add = [&](const std::string& name, const Vec6& e) {
    out.push_back({name, e.head<3>().norm(), e.tail<3>().norm()});
  };
  const Pose& tip = ws.frames.at(m.tip);
  Vec6 e = frame_error(tip, m.home);
  target.mask(e);
  add(m.legs.empty() ? "tcp" : m.legs.front(), e);
  for (const Loop& l : m.loops) {
    const Pose &primary = ws.frames.at(l.primary), &end = ws.frames.at(l.end);
    // Where all of the pose is given, a leg is measured at the TCP that it alone would carry.
    const bool alone = l.leg && m.task == full_task;
    add(l.name, alone ? frame_error(end * (primary.inverse() * tip), m.home) : frame_error(primary, end));
  }
  return out;
}

bool within_limits(const Mechanism& m, const VecX& x) {
  for (Index j = 0; j < m.size(); ++j)
    if (x[j] < m.coordinates[at(j)].lower || x[j] > m.coordinates[at(j)].upper) return false;
  return true;
}

/// Starts ever farther from the declared coordinates; the first closed configuration within the joints'
/// limits, else the first one at all.
bool search_home(const Mechanism& m, const Target& target, ClosureWorkspace& ws, VecX& x) {
  const VecX declared = x;
  VecX beyond;
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> share(-1, 1);
  for (int start = 0; start < most_starts; ++start) {
    x = declared;
    const double stray = std::numbers::pi * start / most_starts;
    for (const Index j : ws.unknown) x[j] += stray * share(random) * m.length / m.unit(j);
    int iterations = 0;
    if (!close(m, target, Pace::damped, ws, x, iterations)) continue;
    if (within_limits(m, x)) return true;
    if (beyond.size() == 0) beyond = x;
  }
  x = beyond.size() ? beyond : declared;
  return beyond.size() != 0;
}

std::string words(const std::vector<Gap>& gaps) {
  std::ostringstream out;
  for (const Gap& g : gaps)
    out << (&g == gaps.data() ? "" : ", ") << g.name << " " << g.translation << " m " << g.rotation << " rad";
  return out.str();
}

/// Appends to the ends of branches in the order in which Mechanism numbered the loops.
class Correction {
 public:
  explicit Correction(const Mechanism& m) : m_(m), frames_(m) {
    forward(m, Geometry::nominal, m.home_coordinates, frames_);
  }

  Chain run() {
    Chain root = m_.description;
    chain(root);
    append(root, frames_.at(m_.tip).inverse() * m_.home);
    return root;
  }

 private:
  void chain(Chain& c) {
    for (auto& element : c.elements) {
      Block* block = std::get_if<Block>(&element);
      if (!block) continue;
      for (std::size_t b = 0; b < block->branches.size(); ++b) {
        Chain& branch = block->branches[b].second;
        chain(branch);
        if (b == 0) continue;
        const Loop& loop = m_.loops[next_++];
        append(branch, frames_.at(loop.end).inverse() * frames_.at(loop.primary));
      }
    }
  }

  static void append(Chain& c, const Pose& by) { c.elements.emplace_back(Offset{"closing", by, by}); }

  const Mechanism& m_;
  Frames frames_;
  std::size_t next_ = 0;
};

}  // namespace

HomeMisfit::HomeMisfit(const HomeFit& of)
    : std::invalid_argument("home configuration: expected coordinates that close every leg and loop, got " +
                            words(of.declared) + ", at best " + words(of.closest)),
      fit(of) {}

HomeFit close_home(Mechanism& m, HomeSearch search) {
  ClosureWorkspace ws(m);
  VecX& x = m.home_coordinates;
  select_unknowns(m, true, ws);
  const Target target{&m.home, m.task};
  HomeFit out;
  out.declared = gaps(m, x, target, ws);
  int iterations = 0;
  VecX closed = x;
  if (search == HomeSearch::anywhere) out.closed = search_home(m, target, ws, closed);
  else out.closed = residual(m, x, target, ws) < near_enough && close(m, target, Pace::damped, ws, closed, iterations);
  out.closest = gaps(m, closed, target, ws);
  if (!out.closed) return out;
  wind(m, ws.frames, closed);
  x = closed;
  if (m.task != full_task) m.home = ws.frames.at(m.tip);
  return out;
}

bool closes_exactly(const Mechanism& m) {
  ClosureWorkspace ws(m);
  return residual(m, m.home_coordinates, {&m.home, m.task}, ws) < round_off;
}

Chain corrected(const Mechanism& m) { return Correction(m).run(); }

}  // namespace stiffmap
