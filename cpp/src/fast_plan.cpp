// SPDX-License-Identifier: MIT
#include "stiffmap/fast_plan.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <list>
#include <map>

#include "../kernels/program.hpp"
#include "stiffmap/parallel.hpp"

namespace stiffmap {

struct FastPlanData {
  Program program{};
  std::vector<Op> ops;
  std::vector<ChainProgram> chains;
  std::vector<LawProgram> laws;
  std::vector<double> knots;
  std::vector<CommandErrorProgram> errors;
  std::vector<DriveProgram> drives;
  std::vector<CoordinateProgram> coordinates;
  std::vector<LegClosure> legs;
  std::vector<ClosureEquation> equations;
  std::vector<ClosureTerm> terms;
  std::vector<std::int32_t> unknowns;
  std::shared_ptr<const std::vector<double>> grid;
};

namespace {

constexpr int most_prefix = 16, most_leg_unknowns = 24;

std::int32_t i32(std::size_t n) { return static_cast<std::int32_t>(n); }
std::int32_t i32(Index n) { return static_cast<std::int32_t>(n); }

Constant constant(const Pose& T) {
  Constant c{};
  for (int i = 0; i < 3; ++i) {
    c.p[i] = T.p[i];
    for (int k = 0; k < 3; ++k) c.R[3 * k + i] = T.R(i, k);
  }
  c.has_rotation = !T.R.isApprox(Mat3::Identity(), 0);
  c.has_translation = !T.p.isZero(0);
  return c;
}

/// Walks the chains in the order in which Mechanism numbered their coordinates.
class Compiler {
 public:
  Compiler(const Mechanism& m, FastPlanData& out, std::string& missing) : m_(m), out_(out), missing_(missing) {}

  void run() {
    out_.chains.emplace_back();
    out_.program.root = 0;
    out_.program.legs_op = -1;
    out_.program.exact_weights = 1;
    chain(m_.description, 0, true, false);
  }

 private:
  struct Way {  // what has been passed since the chain's start
    Pose nominal, actual;
    bool rigid = true, turned = false, moves = false;
    int prefix = 0;
  };

  /// Operations of a chain are contiguous: those of its branches come before them.
  void chain(const Chain& c, std::size_t index, bool outermost, bool start_moves) {
    std::vector<Op> ops;
    Way way;
    way.moves = start_moves;
    for (const auto& element : c.elements) {
      if (const auto* e = std::get_if<Offset>(&element)) {
        way.nominal = way.nominal * e->nominal;
        way.actual = way.actual * e->actual;
      } else if (const auto* j = std::get_if<Joint>(&element)) {
        joint(*j, way, ops);
      } else if (const auto* s = std::get_if<Spring>(&element)) {
        spring(*s, way, ops);
      } else if (const auto* b = std::get_if<Body>(&element)) {
        body(*b, way, ops);
      } else if (const auto* k = std::get_if<Block>(&element)) {
        block(*k, way, ops, outermost);
      }
    }
    ChainProgram& p = out_.chains[index];
    p.first = i32(out_.ops.size());
    p.count = i32(ops.size());
    p.nominal = constant(way.nominal);
    p.actual = constant(way.actual);
    p.first_stiff = -1;
    for (std::size_t i = 0; i < ops.size(); ++i)
      if (p.first_stiff < 0 && (ops[i].kind == OpKind::spring || ops[i].kind == OpKind::block))
        p.first_stiff = p.first + i32(i);
    if (p.first_stiff < 0) missing_ = "a chain without a full link spring";
    if (outermost && out_.program.legs_op >= 0) out_.program.legs_op += p.first;
    out_.ops.insert(out_.ops.end(), ops.begin(), ops.end());
  }

  Op& push(OpKind kind, Way& way, std::vector<Op>& ops) {
    Op op{};
    op.kind = kind;
    op.coordinate = op.law = op.wrench = -1;
    op.nominal = constant(way.nominal);
    op.actual = constant(way.actual);
    way.nominal = way.actual = Pose{};
    ops.push_back(op);
    return ops.back();
  }

  void joint(const Joint& j, Way& way, std::vector<Op>& ops) {
    const Coordinate& c = m_.coordinates[static_cast<std::size_t>(next_)];
    Op& op = push(j.type == JointType::revolute ? OpKind::revolute : OpKind::prismatic, way, ops);
    op.coordinate = next_++;
    op.eliminated = !c.locked;
    op.slot = out_.program.joint_slots++;
    op.law = i32(c.law);
    op.axis = 3;
    for (int i = 0; i < 3; ++i) {
      op.direction[i] = j.axis[i];
      if (j.axis[i] == 1) op.axis = i;
    }
    if (j.actuated) slots_.push_back({op.coordinate, op.slot, j.type == JointType::prismatic});
    if (op.eliminated && way.rigid && ++way.prefix > most_prefix)
      missing_ = "more joints before the first link spring than are supported";
    if (op.eliminated) {
      way.moves = true;
      way.turned = way.turned || j.type == JointType::revolute;
    }
  }

  /// A spring that is full and regular is one operation; one with uncoupled directions, some of them
  /// rigid, free or with a law of their own, is a sequence of elastic joints.
  void spring(const Spring& s, Way& way, std::vector<Op>& ops) {
    Mat6 K = s.matrix.stiffness, whole = K;
    bool corners = false;
    for (const auto& [i, law] : s.laws) {
      corners = corners || law.has_knots() || law.friction() != 0;
      K(i, i) = 0;
      whole(i, i) = law.stiffness();
    }
    const Vec6 d = whole.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const bool deficient =
        s.matrix.rotated || s.matrix.rigid.any() ||
        Eigen::SelfAdjointEigenSolver<Mat6>(d.asDiagonal() * whole * d.asDiagonal()).eigenvalues()[0] < 1e-9;
    if (deficient || corners) {
      if (s.matrix.rotated || !Mat6(K.diagonal().asDiagonal()).isApprox(K, 1e-14))
        missing_ = "a coupled link spring with rigid or free directions or with gaps";
      elastic_joints(s, K, way, ops);
      return;
    }
    Op& op = push(OpKind::spring, way, ops);
    op.coordinate = next_;
    op.slot = out_.program.stiff_slots++;
    next_ += 6;
    for (int i = 0; i < 6; ++i) {
      op.rest[i] = s.rest[i];
      for (int k = 0; k < 6; ++k) op.K[6 * i + k] = K(i, k);
    }
    way.rigid = false;
    way.moves = true;
  }

  void elastic_joints(const Spring& s, const Mat6& K, Way& way, std::vector<Op>& ops) {
    for (int i = 0; i < 6; ++i, ++next_) {
      const Index law = m_.coordinates[static_cast<std::size_t>(next_)].law;
      if (s.matrix.rigid[i] && law < 0) continue;  // a law makes a rigid direction yield
      Op& op = push(i < 3 ? OpKind::prismatic : OpKind::revolute, way, ops);
      op.coordinate = next_;
      op.eliminated = 1;
      op.slot = out_.program.joint_slots++;
      op.axis = i % 3;
      op.direction[i % 3] = 1;
      op.law = i32(law);
      elastic_.push_back({next_, K(i, i), s.rest[i]});
      if (way.rigid && ++way.prefix > most_prefix)
        missing_ = "more joints before the first link spring than are supported";
      way.moves = true;
      way.turned = way.turned || i >= 3;
    }
  }

  void body(const Body& b, Way& way, std::vector<Op>& ops) {
    if (b.mass == 0) return;
    // Behind a joint that starts from rigid, or in a frame that moves, the elimination leaves out how
    // the weight turns in the relative problem (docs/fast_path.md F9).
    if ((way.rigid && way.turned) || in_moving_block_) out_.program.exact_weights = 0;
    Op& op = push(OpKind::load, way, ops);
    op.slot = out_.program.joint_slots++;
    op.mass = b.mass;
    for (int i = 0; i < 3; ++i) op.com[i] = b.com[i];
  }

  void block(const Block& b, Way& way, std::vector<Op>& ops, bool outermost) {
    const std::size_t first = out_.chains.size();
    out_.chains.resize(first + b.branches.size());
    const bool is_legs = outermost && b.name == "legs" && out_.program.legs_op < 0;
    const bool outside = in_moving_block_;
    in_moving_block_ = in_moving_block_ || way.moves;
    const int here = i32(ops.size());
    Op& op = push(OpKind::block, way, ops);
    op.first = i32(first);
    op.count = i32(b.branches.size());
    op.slot = out_.program.stiff_slots++;
    op.start_moves = way.moves;
    for (std::size_t k = 0; k < b.branches.size(); ++k) chain(b.branches[k].second, first + k, false, way.moves);
    in_moving_block_ = outside;
    if (is_legs) {
      out_.program.legs_op = here;
    }
    way.rigid = false;
    way.moves = true;
  }

  const Mechanism& m_;
  FastPlanData& out_;
  std::string& missing_;
  std::int32_t next_ = 0;
  bool in_moving_block_ = false;

 public:
  struct DriveSlot {
    std::int32_t coordinate, slot, prismatic;
  };
  std::vector<DriveSlot> slots_;
  struct Elastic {
    std::int32_t coordinate;
    double stiffness, rest;
  };
  std::vector<Elastic> elastic_;  ///< link springs taken apart
};

/// Closure equations of each leg: its end against the command, and each loop inside it.
class ClosureCompiler {
 public:
  ClosureCompiler(const Mechanism& m, FastPlanData& out) : m_(m), out_(out) {}

  bool run() {
    const Op block = out_.ops[static_cast<std::size_t>(out_.program.legs_op)];
    for (int k = 0; k < block.count; ++k) {
      LegClosure leg{};
      leg.first_equation = i32(out_.equations.size());
      leg.first_unknown = i32(out_.unknowns.size());
      local_.clear();
      std::vector<ClosureTerm> way;
      const int chain = block.first + k;
      follow(chain, way);
      add_equation(chain, -1, way);
      leg.equations = i32(out_.equations.size()) - leg.first_equation;
      leg.unknowns = i32(local_.size());
      if (leg.unknowns > most_leg_unknowns || leg.equations > most_leg_unknowns ||
          out_.unknowns.size() > 8 * most_leg_unknowns)
        return false;
      out_.legs.push_back(leg);
    }
    return true;
  }

 private:
  /// Appends the joints of the primary way through a chain; loops met on it become equations.
  void follow(int chain, std::vector<ClosureTerm>& way) {
    const ChainProgram& c = out_.chains[static_cast<std::size_t>(chain)];
    for (int i = c.first; i < c.first + c.count; ++i) {
      const Op& op = out_.ops[static_cast<std::size_t>(i)];
      if (op.kind == OpKind::block) {
        std::vector<ClosureTerm> primary;
        follow(op.first, primary);
        for (int b = 1; b < op.count; ++b) {
          std::vector<ClosureTerm> loop;
          follow(op.first + b, loop);
          for (ClosureTerm t : primary) {
            t.sign = -t.sign;
            loop.push_back(t);
          }
          add_equation(op.first + b, op.first, loop);
        }
        way.insert(way.end(), primary.begin(), primary.end());
      } else if (op.kind <= OpKind::prismatic) {
        const Coordinate& k = m_.coordinates[static_cast<std::size_t>(op.coordinate)];
        if (k.role == Role::spring || (k.role == Role::passive && k.locked)) continue;
        way.push_back({local(op.coordinate), op.slot, op.kind == OpKind::prismatic, 1.0});
      }
    }
  }

  std::int32_t local(std::int32_t coordinate) {
    const auto [it, added] = local_.try_emplace(coordinate, i32(local_.size()));
    if (added) out_.unknowns.push_back(coordinate);
    return it->second;
  }

  void add_equation(int chain, int primary, const std::vector<ClosureTerm>& terms) {
    out_.equations.push_back({chain, primary, i32(out_.terms.size()), i32(terms.size())});
    out_.terms.insert(out_.terms.end(), terms.begin(), terms.end());
  }

  const Mechanism& m_;
  FastPlanData& out_;
  std::map<std::int32_t, std::int32_t> local_;
};

// ---- closure starts on a grid over the workspace ------------------------------------------------

constexpr int grid_nodes = 8;
constexpr std::size_t cached_grids = 32;

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

/// At a folded or stretched leg Newton starts badly: such a node is no start for its neighbours.
bool nearly_singular(ClosureWorkspace& ws) {
  ws.qr.setThreshold(0.02);
  ws.qr.compute(ws.A);
  return ws.qr.rank() < static_cast<Index>(ws.unknown.size());
}

std::shared_ptr<const std::vector<double>> make_grid(const Mechanism& m, const FastPlanData& d) {
  const Program& p = d.program;
  const auto nodes = static_cast<std::size_t>(p.grid_n[0]) * static_cast<std::size_t>(p.grid_n[1]) *
                     static_cast<std::size_t>(p.grid_n[2]);
  auto grid = std::make_shared<std::vector<double>>(nodes * d.unknowns.size(), std::nan(""));
  std::vector<VecX> x(nodes);
  ClosureWorkspace ws(m);
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
        VecX found = VecX::Zero(m.size());
        ClosureResult r =
            from ? inverse_closure(m, pose, ws, found, *from, start) : inverse_closure(m, pose, ws, found);
        if (from && (r.status != Status::converged || r.flags & flag::branch_unverified))
          r = inverse_closure(m, pose, ws, found);
        if (r.status != Status::converged || r.flags & flag::branch_unverified) continue;
        x[node] = found;
        if (nearly_singular(ws)) continue;
        for (std::size_t u = 0; u < d.unknowns.size(); ++u)
          (*grid)[node * d.unknowns.size() + u] = found[d.unknowns[u]];
      }
  return grid;
}

/// Machines that differ in springs and errors only share one grid.
std::shared_ptr<const std::vector<double>> grid_of(const Mechanism& m, const FastPlanData& d) {
  static RecentValues<std::shared_ptr<const std::vector<double>>> grids(cached_grids);
  return grids.get(GridKey(m, d).text, [&] { return make_grid(m, d); });
}

void place_grid(const Mechanism& m, const Vec3& low, const Vec3& high, FastPlanData& d) {
  Program& p = d.program;
  for (int c = 0; c < 3; ++c) {
    const double size = high[c] - low[c];
    const bool flat = size < 1e-6 * m.length;
    p.grid_n[c] = flat ? 2 : grid_nodes;
    p.grid_low[c] = flat ? low[c] - 5e-4 * m.length : low[c];
    p.grid_step[c] = flat ? 1e-3 * m.length : size / (grid_nodes - 1);
  }
  d.grid = grid_of(m, d);
  p.grid = d.grid->data();
}

void fill_tables(const Mechanism& m, const std::vector<Compiler::DriveSlot>& slots, FastPlanData& d) {
  for (const Law& law : m.laws) {
    d.laws.push_back({law.stiffness(), law.cubic(), law.friction(), i32(d.knots.size() / 3), i32(law.knots().size())});
    for (const auto& [a, tau] : law.knots())
      for (double v : {a, tau, a + tau / law.stiffness()}) d.knots.push_back(v);
    d.program.starts_linear |= law.has_knots() || law.friction() != 0;
  }
  for (const Coordinate& c : m.coordinates) {
    const Index j = static_cast<Index>(&c - m.coordinates.data());
    d.coordinates.push_back({m.home_coordinates[j], c.lower, c.upper, m.unit(j), 0.0, 0.0,
                             static_cast<std::int32_t>(c.role), c.locked, i32(c.law)});
    if (c.role == Role::passive && c.locked) d.program.flag_always |= flag::free_spin;
  }
  for (std::size_t i = 0; i < m.drives.size(); ++i) {
    const Drive& k = m.drives[i];
    for (const CommandError& e : k.errors)
      d.errors.push_back({i32(k.coordinate), e.offset, e.slope, e.amplitude, e.period, e.phase, e.reference});
    d.drives.push_back(
        {slots[i].coordinate, slots[i].slot, slots[i].prismatic, k.home, k.compliance_slope, k.force_limit});
  }
}

/// Legs close one by one only where nothing before or behind their block moves.
bool only_legs_have_joints(const Mechanism& m, const FastPlanData& d) {
  const ChainProgram& root = d.chains[0];
  for (int i = root.first; i < root.first + root.count; ++i) {
    const OpKind kind = d.ops[static_cast<std::size_t>(i)].kind;
    if (kind == OpKind::block && i != d.program.legs_op) return false;
    if (kind > OpKind::prismatic) continue;
    const std::int32_t j = d.ops[static_cast<std::size_t>(i)].coordinate;
    if (m.coordinates[static_cast<std::size_t>(j)].role != Role::spring) return false;
  }
  return true;
}

void link(const Mechanism& m, FastPlanData& d) {
  Program& p = d.program;
  p.ops = d.ops.data();
  p.chains = d.chains.data();
  p.laws = d.laws.data();
  p.knots = d.knots.data();
  p.errors = d.errors.data();
  p.drives = d.drives.data();
  p.coordinates = d.coordinates.data();
  p.legs = d.legs.data();
  p.equations = d.equations.data();
  p.terms = d.terms.data();
  p.unknowns = d.unknowns.data();
  p.op_count = i32(d.ops.size());
  p.chain_count = i32(d.chains.size());
  p.error_count = i32(d.errors.size());
  p.drive_count = i32(d.drives.size());
  p.coordinate_count = i32(d.coordinates.size());
  p.leg_count = i32(d.legs.size());
  p.unknown_count = i32(d.unknowns.size());
  p.flag_force = flag::drive_force;
  p.flag_range = flag::drive_range;
  p.flag_limit = flag::joint_limit;
  p.length = m.length;
  p.stiffness = m.stiffness;
}

}  // namespace

FastPlan::FastPlan(const Mechanism& m, const Vec3& low, const Vec3& high) : data_(std::make_unique<FastPlanData>()) {
  if (!m.external_springs.empty()) missing_ = "external springs";
  if (m.task != full_task) missing_ = "pose components that are not commanded";
  Compiler compiler(m, *data_, missing_);
  compiler.run();
  if (data_->program.legs_op < 0) missing_ = "no legs";
  if (!missing_.empty()) return;
  fill_tables(m, compiler.slots_, *data_);
  for (const Compiler::Elastic& e : compiler.elastic_) {
    CoordinateProgram& c = data_->coordinates[static_cast<std::size_t>(e.coordinate)];
    c.stiffness = e.stiffness;
    c.rest = e.rest;
  }
  const bool box = (high - low).minCoeff() >= 0 && high.allFinite();
  data_->program.closes = box && only_legs_have_joints(m, *data_) && ClosureCompiler(m, *data_).run();
  link(m, *data_);
  if (data_->program.closes) place_grid(m, low, high, *data_);
}

bool FastPlan::nearest_start(const Mechanism& m, const Vec3& position, VecX& x, Pose& at) const {
  const Program& p = data_->program;
  if (!p.grid) return false;
  std::size_t node = 0, stride = 1;
  at = m.home;
  for (int k = 0; k < 3; ++k) {
    const double u = (position[k] - p.grid_low[k]) / p.grid_step[k];
    if (!(u >= -1e-9 && u <= p.grid_n[k] - 1 + 1e-9)) return false;
    const double i = std::round(u);
    node += static_cast<std::size_t>(i) * stride;
    stride *= static_cast<std::size_t>(p.grid_n[k]);
    at.p[k] = p.grid_low[k] + i * p.grid_step[k];
  }
  x = m.home_coordinates;
  const double* g = p.grid + node * data_->unknowns.size();
  for (std::size_t j = 0; j < data_->unknowns.size(); ++j) x[data_->unknowns[j]] = g[j];
  return x.allFinite();
}

FastPlan::~FastPlan() = default;

const Program& FastPlan::program() const { return data_->program; }

}  // namespace stiffmap
