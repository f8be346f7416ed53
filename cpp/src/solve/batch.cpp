// SPDX-License-Identifier: MIT
#include "stiffmap/solve/batch.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "../../kernels/dispatch.hpp"
#include "../plan/data.hpp"
#include "../plan/moved_leg.hpp"
#include "stiffmap/common/check.hpp"
#include "stiffmap/common/parallel.hpp"

namespace stiffmap {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

constexpr long reference_chunk = 16;
constexpr long fast_chunk = 256;
constexpr long patient_chunk = 64;

void read(const BatchInput& in, Index i, PoseInput& pose) {
  pose.commanded = in.commanded(i);
  const Index loads = static_cast<Index>(in.load_points.size());
  for (Index k = 0; k < loads; ++k) pose.wrenches[at(k)] = in.load(i, k);
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

/// The dense path and its scratch, made when first needed.
class Reference {
 public:
  void solve(const Mechanism& m, const BatchInput& in, const SolveOptions& options, Index i, const BatchOutput& out,
             std::uint32_t flags = 0, bool path_ends = false) {
    prepare(m, in);
    if (!ws_) ws_ = std::make_unique<SolveWorkspace>(m);
    read(in, i, pose_);
    pose_.closed = in.closed ? in.closed + m.size() * i : nullptr;
    SolveOptions how = options;
    how.equilibrium.path_ends = path_ends;
    solve_pose(m, pose_, how, *ws_, result_);
    result_.flags |= flags;
    write(m, i, result_, out);
  }

  /// What is said of a pose for which the kernels found that there is no answer.
  void refuse(const Mechanism& m, const BatchInput& in, Index i, Status status, std::uint32_t flags,
              const BatchOutput& out) {
    prepare(m, in);
    result_.flags = flags;
    result_.iterations = status == Status::unreachable || !out.iterations ? 0 : out.iterations[i];
    result_.indeterminate.assign(at(m.size()), false);
    fail_pose(m, pose_, status, result_);
    write(m, i, result_, out);
  }

  /// Closed coordinates for the kernels, NaN where the pose is out of reach; and the tip's pose, where
  /// the task leaves some of it open.
  void close(const Mechanism& m, const BatchInput& in, Index i, double* x, Pose& reached) {
    if (!closure_) closure_ = std::make_unique<ClosureWorkspace>(m);
    const Pose pose = in.commanded(i);
    if (in.closed && m.loops.empty() &&
        m.task == full_task) {  // nothing to close, and the tip is where it is commanded
      std::copy_n(in.closed + m.size() * i, m.size(), x);
      reached = pose;
      return;
    }
    VecX found(m.size());
    if (in.closed) found = Eigen::Map<const VecX>(in.closed + m.size() * i, m.size());
    const ClosureResult r = in.closed ? given_closure(m, *closure_, found) : inverse_closure(m, pose, *closure_, found);
    // A doubtful branch keeps its flag, and a misfit is known to the reference path alone.
    if (r.status != Status::converged || r.flags & flag::branch_unverified || !r.exact) found[0] = std::nan("");
    Eigen::Map<VecX>(x, m.size()) = found;
    reached = m.task == full_task ? pose : r.tip;
  }

 private:
  void prepare(const Mechanism& m, const BatchInput& in) {
    if (!pose_.read_points.empty()) return;
    pose_.load_points = in.load_points;
    pose_.read_points = in.read_points;
    pose_.wrenches.assign(in.load_points.size(), Vec6::Zero());
    pose_.gravity = in.gravity;
    result_.x = VecX::Zero(m.size());
  }

  std::unique_ptr<SolveWorkspace> ws_;
  std::unique_ptr<ClosureWorkspace> closure_;
  PoseInput pose_;
  PoseResult result_;
};

/// Poses closed by the reference path, as the kernels read them: by their places begin .. end-1.
class ClosedPoses {
 public:
  template <class PoseAt>
  void put(const Mechanism& m, const BatchInput& in, Index begin, Index end, const PoseAt& pose_at,
           Reference& reference, KernelInput& out) {
    start_.resize(at(m.size() * fast_chunk));
    position_.resize(at(3 * fast_chunk));
    rotation_.resize(at(9 * fast_chunk));
    Pose reached;
    for (Index i = begin; i < end; ++i) {
      const Index k = i - begin;
      reference.close(m, in, pose_at(i), start_.data() + m.size() * k, reached);
      Eigen::Map<Vec3>(position_.data() + 3 * k) = reached.p;
      Eigen::Map<RowMajor3>(rotation_.data() + 9 * k) = reached.R;
    }
    out.start = start_.data() - m.size() * begin;
    out.position = position_.data() - 3 * begin;
    out.rotation = rotation_.data() - 9 * begin;
    out.one_rotation = false;
  }

 private:
  std::vector<double> start_, position_, rotation_;
};

/// The named point of a load.
Index place_of(const Mechanism& m, const LoadPoint& load) {
  const auto same = [&](const NodePoint& p) { return p.node == load.node && p.offset == load.offset; };
  return std::find_if(m.points.begin(), m.points.end(), same) - m.points.begin();
}

/// Whether a point is of the tip's body beyond the legs.
bool on_tip(const Mechanism& m, const Program& program, Index point) {
  if (point == static_cast<Index>(m.points.size()) || !m.beyond_legs[at(m.points[at(point)].node)]) return false;
  return program.places[point].on_tip;
}

/// What the kernels do not do is left to the reference path as a whole.
bool takes(const Mechanism& m, const FastPlan& plan, const BatchInput& in, const SolveOptions& options) {
  if (!plan.available() || options.equilibrium.load_steps > 0 || in.load_points.empty()) return false;
  const LoadPoint& first = in.load_points.front();
  const NodePoint& reading = m.points[at(in.read_points.front())];
  if (first.node != reading.node || first.offset != reading.offset) return false;
  for (const LoadPoint& load : in.load_points)
    if (!on_tip(m, plan.program(), place_of(m, load))) return false;
  if (!plan.heavy_spins() || in.gravity.isZero(0)) return true;
  return plan.program().hanging && in.variants.empty() && in.load_points.size() == 1;
}

KernelInput kernel_input(const BatchInput& in, const SolveOptions& options) {
  KernelInput k{};
  k.count = in.count;
  k.position = in.position;
  k.rotation = in.rotation;
  k.wrench = in.wrench;
  k.one_rotation = in.one_rotation;
  k.one_wrench = in.one_wrench;
  for (int i = 0; i < 3; ++i) k.gravity[i] = in.gravity[i];
  k.point = i32(in.read_points.front());
  k.max_iterations = 16;
  k.tolerance = options.equilibrium.tolerance;
  k.turns = static_cast<LoadTurns>(in.load_points.front().type);
  return k;
}

/// Memory of the calling thread, kept for its next call: a new piece costs more page faults than a pose.
void* kernel_scratch(std::int64_t bytes) {
  thread_local std::unique_ptr<char[]> memory;
  thread_local std::int64_t size = 0;
  if (bytes > size) {
    memory = std::make_unique_for_overwrite<char[]>(static_cast<std::size_t>(bytes));
    size = bytes;
  }
  return memory.get();
}

/// One call of the fast path: all poses in one quick pass, what that leaves packed into two patient ones, the rest to
/// the reference path.
class FastBatch {
 public:
  FastBatch(const Mechanism& m, const FastPlan& plan, const BatchInput& in, const SolveOptions& options, int threads,
            const BatchOutput& out)
      : m_(m),
        program_(plan.program()),
        in_(in),
        options_(options),
        out_(out),
        threads_(threads),
        done_(at(in.count), pose_slow),
        flags_(at(in.count), 0),
        scratch_(at(std::max(1, threads))) {
    if (out.indeterminate) {
      open_.reserve(m.coordinates.size());
      const bool heavy = !in.gravity.isZero(0);
      for (Index j = 0; j < m.size(); ++j) {
        const Coordinate& c = m.coordinates[at(j)];
        open_.push_back(c.locked && c.role == Role::passive && !(heavy && plan.hangs(j)));
      }
    }
    for (std::size_t k = 1; k < in.read_points.size(); ++k) reads_.push_back(i32(in.read_points[k]));
    for (std::size_t k = 1; k < in.load_points.size(); ++k)
      loads_.push_back(
          {i32(place_of(m, in.load_points[k])), static_cast<LoadTurns>(static_cast<int>(in.load_points[k].type))});
    for (const FastPlan* v : in.variants) {
      require(v->available() && v->program().op_count == program_.op_count &&
                  v->program().coordinate_count == program_.coordinate_count,
              "variants", "plans of the same elements", v->missing());
      variants_.push_back(&v->program());
      moved_.push_back(moved_leg(program_, v->program()));
    }
  }

  void run() {
    kernels(in_.count, fast_chunk, nullptr, Patience::quick);
    std::vector<std::int64_t> left;
    const auto collect = [&](auto&& wanted) {
      for (Index i = 0; i < in_.count; ++i)
        if (wanted(done_[at(i)])) left.push_back(i);
    };
    // Side by side with their like: those that don't close yet, then those whose load is followed.
    const auto again = [&](std::uint8_t which, Patience patience) {
      left.clear();
      collect([which](std::uint8_t how) { return how == which; });
      if (!left.empty()) kernels(static_cast<Index>(left.size()), patient_chunk, left.data(), patience);
    };
    again(pose_slow, Patience::leaps);
    again(pose_heavy, Patience::path);
    again(pose_heavy, Patience::long_path);
    left.clear();
    collect([](std::uint8_t how) { return how == pose_left || how == pose_ended; });
    parallel_chunks(static_cast<long>(left.size()), 1, threads_, [&](int thread, long begin, long end) {
      for (long k = begin; k < end; ++k) {
        poll(thread);
        const std::int64_t i = left[at(k)];
        scratch_[at(thread)].reference.solve(m_, in_, options_, i, out_, flag::reference_path,
                                             done_[at(i)] == pose_ended);
        forget_variants(i);
      }
    });
  }

 private:
  struct Scratch {
    ClosedPoses closed;
    Reference reference;
  };
  const Mechanism& m_;
  const Program& program_;
  const BatchInput& in_;
  const SolveOptions& options_;
  const BatchOutput& out_;
  int threads_;
  bool corners_ = has_knots(m_);
  std::vector<std::uint8_t> open_;  ///< coordinates that every pose leaves open
  std::vector<std::uint8_t> done_;
  std::vector<std::uint32_t> flags_;
  std::vector<Scratch> scratch_;
  std::vector<std::int32_t> reads_;  ///< reading points and loads besides the first
  std::vector<FurtherLoad> loads_;
  std::vector<const Program*> variants_;
  std::vector<std::int32_t> moved_;

  void poll(int thread) const {
    if (thread == 0 && in_.poll) in_.poll();
  }

  /// `index`: the poses of a later pass; null: all.
  void kernels(Index count, long chunk, const std::int64_t* index, Patience patience) {
    const KernelTable& table = kernel(count);
    const KernelOutput answer{out_.displacement,
                              options_.stiffness ? out_.stiffness : nullptr,
                              options_.stiffness ? out_.compliance : nullptr,
                              out_.effort,
                              out_.leg_wrench,
                              out_.coordinates,
                              out_.free_twists,
                              out_.variants,
                              done_.data(),
                              flags_.data(),
                              out_.iterations};
    const auto pose_at = [&](Index place) { return index ? index[place] : place; };
    parallel_chunks(count, chunk, threads_, [&](int thread, long begin, long end) {
      poll(thread);
      Scratch& s = scratch_[at(thread)];
      KernelInput input = kernel_input(in_, options_);
      input.read_count = i32(reads_.size());
      input.reads = reads_.data();
      input.load_count = i32(loads_.size());
      input.loads = loads_.data();
      input.index = index;
      input.patience = patience;
      input.perturbed = variants_.data();
      input.perturbed_leg = moved_.data();
      input.perturbed_count =
          out_.variants && !program_.deficient && !program_.floating ? static_cast<std::int32_t>(variants_.size()) : 0;
      if (in_.closed || !program_.closes) s.closed.put(m_, in_, begin, end, pose_at, s.reference, input);
      table.run(&program_, &input, &answer, begin, end, kernel_scratch(table.scratch_size(&program_)));
      for (long place = begin; place < end; ++place) {
        const Index i = pose_at(place);
        const bool doubtful = done_[at(i)] == pose_unstable && (flags_[at(i)] & flag::branch_unverified);
        if (doubtful || (done_[at(i)] == pose_solved && leapt(i))) done_[at(i)] = pose_left;
        const std::uint8_t how = done_[at(i)];
        if (how == pose_solved || how == pose_unstable || how == pose_loose) complete(i, how);
        else if (how == pose_unreachable || how == pose_nowhere)
          s.reference.refuse(m_, in_, i, how == pose_nowhere ? Status::not_converged : Status::unreachable,
                             flags_[at(i)], out_);
        if (how != pose_solved || program_.deficient || program_.floating) forget_variants(i);
      }
    });
  }

  /// Whether corners of laws may have led a pose to another assembly: the reference path goes there in steps.
  bool leapt(Index i) const {
    if (!corners_ || !out_.displacement) return false;
    const Index reads = std::max<Index>(1, static_cast<Index>(in_.read_points.size()));
    const Eigen::Map<const Vec6> d(out_.displacement + 6 * i * reads);
    return leaps(m_, Pose{}, {d.head<3>(), exp_so3(d.tail<3>())});
  }

  /// Fills what the kernels leave out for a pose that they did.
  void complete(Index i, std::uint8_t how) const {
    const bool loose = how == pose_loose;
    const Status status = how == pose_unstable ? Status::unstable : loose ? Status::singular : Status::converged;
    if (out_.status) out_.status[i] = static_cast<std::uint8_t>(status);
    if (loose && out_.free_twists) Eigen::Map<RowMajor6>(out_.free_twists + 36 * i).rightCols<5>().setConstant(nan);
    else if (out_.nothing_free) out_.nothing_free[i] = 1;
    else if (out_.free_twists) Eigen::Map<VecX>(out_.free_twists + 36 * i, 36).setConstant(nan);
    if (out_.indeterminate) std::copy(open_.begin(), open_.end(), out_.indeterminate + m_.size() * i);
    bool circulatory = false;
    const Index loads = static_cast<Index>(in_.load_points.size());
    for (Index k = 0; k < loads; ++k)
      circulatory = circulatory || nonconservative(in_.load_points[at(k)].type, in_.load(i, k));
    const std::uint32_t play = loose ? flag::free_play | flag::platform_singular : 0u;
    if (out_.flags) out_.flags[i] = flags_[at(i)] | play | (circulatory ? flag::nonconservative : 0u);
  }

  void forget_variants(Index i) const {
    const Index n = 6 * static_cast<Index>(variants_.size());
    if (out_.variants) Eigen::Map<VecX>(out_.variants + n * i, n).setConstant(std::nan(""));
  }
};

}  // namespace

void BatchInput::take(const Mechanism& m, const Rows& positions, const Rows& rotations, const Rows& wrenches,
                      const Rows& known) {
  one_rotation = rotations.rows() == 1;
  one_wrench = wrenches.rows() == 1;
  check_rows(positions, "position", count, 3);
  check_rows(rotations, "rotation", one_rotation ? 1 : count, 9);
  check_rows(wrenches, "wrench", one_wrench ? 1 : count, 6 * static_cast<Index>(load_points.size()));
  check_rows(known, "closed coordinates", count, m.size(), true);
  require(!read_points.empty(), "read_points", "at least one point", 0);
  position = positions.data();
  rotation = rotations.data();
  wrench = wrenches.data();
  closed = known.data();
}

void solve_batch(const Mechanism& m, const FastPlan* plan, const BatchInput& in, const SolveOptions& options,
                 int threads, const BatchOutput& out) {
  if (plan && takes(m, *plan, in, options)) return FastBatch(m, *plan, in, options, threads, out).run();
  const Index n = in.count * 6 * static_cast<Index>(in.variants.size());
  if (out.variants) Eigen::Map<VecX>(out.variants, n).setConstant(std::nan(""));
  std::vector<Reference> scratch(at(std::max(1, threads)));
  parallel_chunks(in.count, reference_chunk, threads, [&](int thread, long begin, long end) {
    for (long i = begin; i < end; ++i) {
      if (thread == 0 && in.poll) in.poll();
      scratch[static_cast<std::size_t>(thread)].solve(m, in, options, i, out);
    }
  });
  for (Index i = 0; plan && out.flags && i < in.count; ++i) out.flags[i] |= flag::reference_path;
}

}  // namespace stiffmap
