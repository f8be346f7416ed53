// SPDX-License-Identifier: MIT
#include "stiffmap/closure/redundancy.hpp"

#include <algorithm>
#include <random>

#include "closing.hpp"

namespace stiffmap {
namespace {

using namespace closing;

constexpr int trials = 4;
constexpr double apart = 1e-6;  // share of the drives in a motion, below which they stand still
constexpr double stray = 0.2;   // rad, or the same share of the length: how far from home they are made

struct Open {
  Index all = 0, driven = 0;  ///< motions that the commanded pose leaves open; how many of them drives tell apart
};

Open open_motions(const Mechanism& m, const VecX& x, ClosureWorkspace& ws) {
  forward(m, Geometry::nominal, x, ws.frames);
  const Pose tip = ws.frames.at(m.tip);
  equations(m, {&tip, m.task}, ws);
  ws.qr.compute(ws.A, rank_threshold);
  const MatX Z = ws.qr.null_vectors();
  MatX drives(Z.rows(), Z.cols());
  Index rows = 0;
  for (std::size_t k = 0; k < ws.unknown.size(); ++k)
    if (m.coordinates[at(ws.unknown[k])].role == Role::actuator) drives.row(rows++) = Z.row(static_cast<Index>(k));
  if (rows == 0 || Z.cols() == 0) return {Z.cols(), 0};
  // The motions are of length 1: drives that go along by round-off alone stand still.
  return {Z.cols(), (singular_vectors(MatX(drives.topRows(rows))).values.array() > apart).count()};
}

}  // namespace

void find_redundancy(Mechanism& m) {
  m.redundancy = 0;
  m.nearness.resize(0);
  ClosureWorkspace ws(m);
  select_unknowns(m, true, ws);
  if (ws.unknown.empty()) return;
  Open least = open_motions(m, m.home_coordinates, ws);
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> share(-1, 1);
  // Some are open at a singular home alone.
  for (int k = 0; k < trials && least.driven > 0; ++k) {
    VecX x = m.home_coordinates;
    for (const Index j : ws.unknown) x[j] += stray * share(random) * m.length / m.unit(j);
    int iterations = 0;
    if (!m.loops.empty() && !close(m, Target{}, Pace::damped, ws, x, iterations)) continue;
    const Open here = open_motions(m, x, ws);
    least = {std::min(least.all, here.all), std::min(least.driven, here.driven)};
  }
  if (least.driven == 0) return;
  m.redundancy = least.all;
  m.nearness.setZero(m.size());
  for (const Index j : ws.unknown)
    if (least.driven < least.all || m.coordinates[at(j)].role == Role::actuator) m.nearness[j] = 1;
}

}  // namespace stiffmap
