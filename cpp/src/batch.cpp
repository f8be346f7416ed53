// SPDX-License-Identifier: MIT
#include "stiffmap/batch.hpp"

#include <memory>

#include "stiffmap/parallel.hpp"

namespace stiffmap {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

void read(const BatchInput& in, Index i, PoseInput& pose) {
  pose.commanded.p = Eigen::Map<const Vec3>(in.position + 3 * i);
  pose.commanded.R = Eigen::Map<const RowMajor3>(in.rotation + 9 * i);
  for (std::size_t k = 0; k < in.load_points.size(); ++k)
    pose.wrenches[k] =
        Eigen::Map<const Vec6>(in.wrench + 6 * (i * static_cast<Index>(in.load_points.size()) + static_cast<Index>(k)));
}

void write(const Mechanism& m, Index i, const PoseResult& r, const BatchOutput& out) {
  const Index reads = static_cast<Index>(r.displacement.size());
  if (out.displacement)
    for (Index k = 0; k < reads; ++k) Eigen::Map<Vec6>(out.displacement + 6 * (i * reads + k)) = r.displacement[at(k)];
  if (out.stiffness) Eigen::Map<RowMajor6>(out.stiffness + 36 * i) = r.point.stiffness;
  if (out.compliance) Eigen::Map<RowMajor6>(out.compliance + 36 * i) = r.point.compliance;
  if (out.free_twists) Eigen::Map<RowMajor6>(out.free_twists + 36 * i) = r.point.free_twists;
  if (out.effort) Eigen::Map<VecX>(out.effort + r.effort.size() * i, r.effort.size()) = r.effort;
  if (out.leg_wrench)
    for (Index k = 0; k < r.leg_wrench.cols(); ++k)
      Eigen::Map<Vec6>(out.leg_wrench + 6 * (i * r.leg_wrench.cols() + k)) = r.leg_wrench.col(k);
  if (out.coordinates) Eigen::Map<VecX>(out.coordinates + m.size() * i, m.size()) = r.x;
  if (out.indeterminate)
    for (Index j = 0; j < m.size(); ++j) out.indeterminate[m.size() * i + j] = r.indeterminate[at(j)];
  if (out.status) out.status[i] = static_cast<std::uint8_t>(r.status);
  if (out.flags) out.flags[i] = r.flags;
  if (out.iterations) out.iterations[i] = r.iterations;
}

}  // namespace

void solve_batch(const Mechanism& m, const BatchInput& in, const SolveOptions& options, int threads,
                 const BatchOutput& out) {
  struct Scratch {
    std::unique_ptr<SolveWorkspace> ws;
    PoseInput pose;
    PoseResult result;
  };
  std::vector<Scratch> scratch(at(std::max(1, threads)));
  parallel_chunks(in.count, 16, threads, [&](int thread, long begin, long end) {
    Scratch& s = scratch[static_cast<std::size_t>(thread)];
    if (!s.ws) {
      s.ws = std::make_unique<SolveWorkspace>(m);
      s.pose.load_points = in.load_points;
      s.pose.read_points = in.read_points;
      s.pose.wrenches.assign(in.load_points.size(), Vec6::Zero());
      s.pose.gravity = in.gravity;
    }
    for (long i = begin; i < end; ++i) {
      read(in, i, s.pose);
      solve_pose(m, s.pose, options, *s.ws, s.result);
      write(m, i, s.result, out);
    }
  });
}

}  // namespace stiffmap
