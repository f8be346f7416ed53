// SPDX-License-Identifier: MIT
// Closure starts on a grid over the workspace.
#include <algorithm>
#include <cmath>

#include "closure.hpp"
#include "stiffmap/closure/closure.hpp"
#include "stiffmap/closure/pose_closer.hpp"
#include "stiffmap/common/parallel.hpp"

namespace stiffmap {
namespace {

constexpr std::size_t cached_grids = 32;
constexpr double sound = 0.05;     // least pivot of a node that is far from singular
constexpr int most_steps = 12000;  // of searches, in all: a box mostly far or out of reach is not searched on

/// Everything that the nominal closure depends on, as a key: joints and the constant transforms between
/// them. Springs, weights and errors are left out, so that variants of one machine share their grid.
class GridKey {
 public:
  GridKey(const Mechanism& m, const FastPlanData& d) : m_(m), d_(d) {
    chain(d.program.root);
    add(d.program.grid_n);
    add(d.program.grid_low);
    add(d.program.grid_step);
    add(m.home.p);
    add(m.home.R);
    add(m.task);
    add(d.program.closes);
    for (const double w : m.nearness) add(w);
  }

  std::string text;

 private:
  template <class T>
  void add(const T& value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  }

  static Pose pose(const Constant& c) { return {Vec3(c.p[0], c.p[1], c.p[2]), Mat3(Eigen::Map<const Mat3>(c.R))}; }

  void chain(std::int32_t index) {
    const ChainProgram& c = d_.chains[static_cast<std::size_t>(index)];
    Pose way;
    const auto flush = [&] {
      add(way.p);
      add(way.R);
      way = Pose{};
    };
    for (int i = c.first; i < c.first + c.count; ++i) {
      const Op& op = d_.ops[static_cast<std::size_t>(i)];
      way = way * pose(op.nominal);
      if (op.kind == OpKind::block) {
        flush();
        add(op.count);
        for (int b = 0; b < op.count; ++b) chain(op.first + b);
      } else if (op.kind <= OpKind::prismatic &&
                 m_.coordinates[static_cast<std::size_t>(op.coordinate)].role != Role::spring) {
        flush();
        add(op.kind);
        add(op.direction);
        add(m_.coordinates[static_cast<std::size_t>(op.coordinate)].role);
        add(m_.coordinates[static_cast<std::size_t>(op.coordinate)].home);
      }
    }
    way = way * pose(c.nominal);
    flush();
  }

  const Mechanism& m_;
  const FastPlanData& d_;
};

/// Motions that the closure determines where it is not nearly singular; at a folded or stretched leg Newton starts
/// badly: such a node is no start for its neighbours.
Index determined(ClosureWorkspace& ws) {
  ws.qr.compute(ws.A, 0.02);
  return ws.qr.rank();
}

std::shared_ptr<const std::vector<double>> make_grid(const Mechanism& m, const FastPlanData& d) {
  const Program& p = d.program;
  const auto nodes = static_cast<std::size_t>(p.grid_n[0]) * static_cast<std::size_t>(p.grid_n[1]) *
                     static_cast<std::size_t>(p.grid_n[2]);
  const auto row = static_cast<std::size_t>(p.grid_row);
  auto grid = std::make_shared<std::vector<double>>(nodes * row, 0.0);
  std::vector<VecX> x(nodes);
  ClosureWorkspace ws(m);
  PoseCloser quick(m);
  VecX home = VecX::Zero(m.size());
  inverse_closure(m, m.home, ws, home);
  const Index at_home = determined(ws);
  int steps = 0;
  for (int k = 0; k < p.grid_n[2]; ++k)
    for (int j = 0; j < p.grid_n[1]; ++j)
      for (int i = 0; i < p.grid_n[0]; ++i) {
        const int index[3] = {i, j, k};
        const int stride[3] = {1, p.grid_n[0], p.grid_n[0] * p.grid_n[1]};
        const std::size_t node = static_cast<std::size_t>(i + j * stride[1] + k * stride[2]);
        Pose pose = m.home;
        for (int c = 0; c < 3; ++c) pose.p[c] = p.grid_low[c] + index[c] * p.grid_step[c];
        const VecX* from = nullptr;
        Pose start = m.home;
        for (int c = 0; c < 3 && !from; ++c) {
          if (index[c] == 0) continue;
          const VecX& before = x[node - static_cast<std::size_t>(stride[c])];
          if (before.size() == 0) continue;
          from = &before;
          start = pose;
          start.p[c] -= p.grid_step[c];
        }
        double* const unknowns = grid->data() + node * row;
        std::fill_n(unknowns, d.unknowns.size(), std::nan(""));
        const auto keep = [&](const VecX& found) {
          // In single precision: with all digits answers would keep those in which libraries of sines differ.
          for (std::size_t u = 0; u < d.unknowns.size(); ++u) unknowns[u] = static_cast<float>(found[d.unknowns[u]]);
        };
        VecX found = from ? *from : VecX::Constant(m.size(), std::nan(""));
        if (m.redundancy == 0 && quick.close(m, pose, found, false).status == Status::converged &&
            quick.pivot(m, pose) > sound) {
          x[node] = found;
          keep(found);
          continue;
        }
        if (steps > most_steps) continue;
        found.setZero();
        ClosureResult r =
            from ? inverse_closure(m, pose, ws, found, *from, start) : inverse_closure(m, pose, ws, found);
        const auto lost = [&r] { return r.status != Status::converged || r.flags & flag::branch_unverified; };
        steps += r.iterations;
        if (from && lost()) {
          r = inverse_closure(m, pose, ws, found);
          steps += r.iterations;
        }
        if (lost()) continue;
        x[node] = found;
        if (determined(ws) >= at_home) keep(found);
      }
  return grid;
}

/// Machines that differ in springs and errors only share one grid.
std::shared_ptr<const std::vector<double>> grid_of(const Mechanism& m, const FastPlanData& d) {
  static RecentValues<std::shared_ptr<const std::vector<double>>> grids(cached_grids);
  return grids.get(GridKey(m, d).text, [&] { return make_grid(m, d); });
}

}  // namespace

void place_grid(const Mechanism& m, const Vec3& low, const Vec3& high, int grid_nodes, FastPlanData& d) {
  Program& p = d.program;
  for (int c = 0; c < 3; ++c) {
    const double size = high[c] - low[c];
    const bool flat = size < 1e-6 * m.length;
    p.grid_n[c] = flat ? 1 : grid_nodes;
    p.grid_low[c] = low[c];
    p.grid_step[c] = flat ? 1e-3 * m.length : size / (grid_nodes - 1);
  }
  p.grid_row = (p.unknown_count + 7) / 8 * 8;
  d.grid = grid_of(m, d);
  p.grid = d.grid->data();
}

}  // namespace stiffmap
