// SPDX-License-Identifier: MIT
#include "stiffmap/plan/fast_plan.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "chains.hpp"
#include "closure.hpp"
#include "places.hpp"
#include "spins.hpp"
#include "stiffmap/equilibrium/spins.hpp"
#include "stiffmap/kinematics/pull.hpp"

namespace stiffmap {
namespace {

constexpr double narrow_in_lanes =
    0.1;  // spread of a free ball's axes below which a lane is left to the reference path

/// Strokes in the order of their operations' numbers.
void add_strokes(const Mechanism& m, FastPlanData& d) {
  for (std::size_t i = 0; i < d.ops.size(); ++i) {
    const Op& op = d.ops[i];
    if (op.kind != OpKind::spring || op.stroke < 0) continue;
    for (const SpringGroup& g : m.groups) {
      if (g.first != op.coordinate) continue;
      const Stroke& t = *g.stroke;
      StrokeProgram p{i32(i),
                      i32(g.varies_with),
                      t.along,
                      i32(d.stroke_rows.size() / stroke_row),
                      i32(t.table.size()),
                      t.at,
                      t.length,
                      t.rate,
                      0.0};
      if (!t.table.empty()) p.slack = Stroke::slack * (t.table.back().first - t.table.front().first);
      for (const auto& [u, C] : t.table) {
        d.stroke_rows.push_back(u);
        d.stroke_rows.insert(d.stroke_rows.end(), C.data(), C.data() + 36);
      }
      d.ops[i].stroke = i32(d.strokes.size());
      d.strokes.push_back(p);
    }
  }
}

void put(const Vec3& v, double (&out)[3]) {
  for (int i = 0; i < 3; ++i) out[i] = v[i];
}

TipSpringProgram tip_spring(const NodeSpring& s, const FromTip& tip) {
  TipSpringProgram k{};
  put(tip.actual * s.offset, k.offset);
  put(s.anchor, k.anchor);
  k.stiffness = s.stiffness;
  k.length = s.length;
  k.tension_only = s.tension_only;
  k.coordinate = -1;
  if (!s.winch) return k;
  const Winch& w = *s.winch;
  put(tip.actual * Vec3(s.offset + w.point_error), k.offset);
  put(s.anchor + w.anchor_error, k.anchor);
  put(tip.nominal * s.offset, k.nominal_offset);
  put(s.anchor, k.nominal_anchor);
  put(w.axis, k.axis);
  k.tension_only = 1;
  k.coordinate = i32(s.coordinate);
  k.radius = w.radius;
  k.fixed = pull_of(s, 0, 0, true).stiffness;
  k.fixed = 1 / k.fixed;
  k.per_length = w.elasticity > 0 ? 1 / (w.elasticity * w.factor) : 0;
  k.slope = commanded_slope(s);
  k.stretch = -commanded_length(s, 0) / k.slope;
  return k;
}

/// The platform that floats: its free joints, and its bodies as one.
std::string fill_floating(const Mechanism& m, FastPlanData& d) {
  Program& p = d.program;
  const auto& free = m.path[static_cast<std::size_t>(m.tip)];
  if (free.size() != 6) return "a platform in cables that guides hold";
  Frames f(m);
  forward(m, Geometry::nominal, m.home_coordinates, f);
  const Node& first = m.nodes[static_cast<std::size_t>(m.coordinates[static_cast<std::size_t>(free[0])].node)];
  const Vec3 body = f.at(m.coordinates[static_cast<std::size_t>(free[5])].node).p;
  put(f.at(first.parent).p, p.guide);
  put(m.home.p - body, p.tip_from_body);
  for (std::size_t i = 0; i < 6; ++i) p.free[i] = i32(free[i]);
  Vec3 moment = Vec3::Zero();
  for (const NodeBody& b : m.bodies) {
    const FromTip tip = from_tip(m, b.node);
    if (!tip.rigid) continue;  // of the base
    p.weight += b.mass;
    moment += b.mass * (tip.actual * b.com);
  }
  if (p.weight > 0) put(moment / p.weight, p.weight_at);
  p.floating = 1;
  return "";
}

void fill_tables(const Mechanism& m, const CompiledChains& chains, FastPlanData& d) {
  for (const Law& law : m.laws) {
    d.laws.push_back({law.stiffness(), law.cubic(), law.friction(), i32(d.knots.size() / 3), i32(law.knots().size())});
    for (const auto& [a, tau] : law.knots())
      for (double v : {a, tau, a + tau / law.stiffness()}) d.knots.push_back(v);
    d.program.starts_linear |= law.has_knots() || law.friction() != 0;
    d.program.hardens |= law.cubic() > 0;
  }
  for (const Coordinate& c : m.coordinates) {
    const Index j = static_cast<Index>(&c - m.coordinates.data());
    d.coordinates.push_back({m.home_coordinates[j], c.lower, c.upper, m.unit(j), 0.0, m.rest[j], c.friction, 0.0, 0,
                             static_cast<std::int32_t>(c.role), c.locked, i32(c.law), c.from_home(), 0});
    d.program.starts_linear |= c.friction != 0;
    if (c.role == Role::passive && c.locked) d.program.flag_always |= flag::free_spin;
  }
  for (const Ball& b : m.balls) {
    CoordinateProgram& c = d.coordinates[static_cast<std::size_t>(b.first + 1)];
    c.middle = b.middle;
    c.ball = b.free ? 2 : 1;
    d.program.free_balls |= b.free;
  }
  for (std::size_t i = 0; i < m.drives.size(); ++i) {
    const Drive& k = m.drives[i];
    for (const auto& [moves, of, e] : k.errors) {
      d.errors.push_back({i32(moves), i32(of), i32(d.error_knots.size() / 2), i32(e.knots.size()), e.offset, e.slope,
                          e.amplitude, e.period, e.phase, e.reference});
      for (const auto& [u, error] : e.knots) d.error_knots.insert(d.error_knots.end(), {u, error});
    }
    const bool cable = m.coordinates[static_cast<std::size_t>(k.coordinate)].cable >= 0;
    const auto joint = cable ? DriveSlot{i32(k.coordinate), -1, 1} : chains.drives[i];
    d.drives.push_back({joint.coordinate, joint.slot, joint.prismatic, m.home_coordinates[k.coordinate],
                        k.numbers.compliance_slope, k.numbers.force_limit, k.numbers.sag});
    d.program.sags |= k.numbers.sag != 0;
  }
  add_strokes(m, d);
  for (const ElasticJoint& e : chains.elastic) {
    CoordinateProgram& c = d.coordinates[static_cast<std::size_t>(e.coordinate)];
    c.stiffness = e.stiffness;
    if (e.stiffness > 0) c.rest = e.rest;
  }
  for (const Op& op : d.ops) {
    if (op.kind > OpKind::prismatic || !op.eliminated || op.law < 0) continue;
    const Law& law = m.laws[static_cast<std::size_t>(op.law)];
    d.coordinates[static_cast<std::size_t>(op.coordinate)].by_force = !law.has_knots() && law.cubic() > 0;
  }
}

/// Pivots of a sound machine are not far below its softest spring, however stiff the others are.
double softest(const Mechanism& m) {
  double least = m.stiffness;
  const auto add = [&](double k) { least = k > 0 ? std::min(least, k) : least; };
  for (const SpringGroup& g : m.groups)
    for (int i = 0; i < 6; ++i) add(g.matrix.stiffness(i, i) / (i < 3 || g.matrix.rotated ? 1.0 : m.length * m.length));
  for (Index j = 0; j < m.size(); ++j) {
    const Index law = m.coordinates[static_cast<std::size_t>(j)].law;
    if (law >= 0) add(m.laws[static_cast<std::size_t>(law)].stiffness() / (m.unit(j) * m.unit(j)));
  }
  return std::max(1e-4, least / m.stiffness);
}

/// Joints and bodies of a machine that is one row of joints without springs; false where it is something else.
bool follow_serial(const FastPlanData& d, std::int32_t chain, std::vector<std::int32_t>& ops) {
  const ChainProgram& c = d.chains[static_cast<std::size_t>(chain)];
  for (std::int32_t i = c.first; i < c.first + c.count; ++i) {
    const Op& op = d.ops[static_cast<std::size_t>(i)];
    if (op.kind == OpKind::spring || (op.kind == OpKind::block && op.count > 1)) return false;
    if (op.kind == OpKind::block && !follow_serial(d, op.first, ops)) return false;
    if (op.kind == OpKind::load || (op.kind <= OpKind::prismatic && op.eliminated)) ops.push_back(i);
  }
  return true;
}

void find_serial(const Mechanism& m, FastPlanData& d) {
  constexpr long most_joints = 12;  // as serial.hpp of the kernels
  d.program.serial_joints = -1;
  if (m.floating || !follow_serial(d, d.program.root, d.serial)) return;
  const auto joints = std::count_if(d.serial.begin(), d.serial.end(), [&](std::int32_t i) {
    return d.ops[static_cast<std::size_t>(i)].kind != OpKind::load;
  });
  if (joints > most_joints) return;
  d.program.serial = d.serial.data();
  d.program.serial_count = i32(d.serial.size());
  d.program.serial_joints = static_cast<std::int32_t>(joints);
}

/// Whether the joints of an arm of joints alone leave some motion of its tip impossible, wherever they are.
bool is_deficient(const Mechanism& m, const FastPlanData& d) {
  if (d.program.serial_joints < 0) return false;
  if (d.program.serial_joints < 6) return true;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> turn(-1, 1);
  Frames f(m);
  MatX J(6, d.program.serial_joints);
  for (int trial = 0; trial < 5; ++trial) {
    VecX x = m.home_coordinates;
    for (Index j = 0; j < m.size(); ++j) x[j] += turn(random) * m.unit(j);
    forward(m, Geometry::nominal, x, f);
    Index k = 0;
    for (const std::int32_t i : d.serial) {
      const Op& op = d.ops[static_cast<std::size_t>(i)];
      if (op.kind == OpKind::load) continue;
      J.col(k) = column(m, f, op.coordinate, f.at(m.tip).p) * m.unit(op.coordinate);
      J.col(k++).tail<3>() *= m.length;
    }
    const VecX sizes = J.jacobiSvd().singularValues();
    if (sizes[5] > 1e-12 * sizes[0]) return false;
  }
  return true;
}

void link(const Mechanism& m, FastPlanData& d) {
  Program& p = d.program;
  p.ops = d.ops.data();
  p.chains = d.chains.data();
  p.laws = d.laws.data();
  p.knots = d.knots.data();
  p.strokes = d.strokes.data();
  p.stroke_rows = d.stroke_rows.data();
  p.stroke_count = i32(d.strokes.size());
  p.errors = d.errors.data();
  p.error_knots = d.error_knots.data();
  p.drives = d.drives.data();
  p.coordinates = d.coordinates.data();
  p.legs = d.legs.data();
  p.equations = d.equations.data();
  p.terms = d.terms.data();
  p.unknowns = d.unknowns.data();
  p.envelope = d.envelope.data();
  p.reach = d.reach.data();
  p.springs = d.springs.data();
  p.spring_count = i32(d.springs.size());
  p.places = d.places.data();
  p.place_steps = d.place_steps.data();
  p.planar = d.planar.empty() ? nullptr : d.planar.data();
  p.arm = d.arm.empty() ? nullptr : d.arm.data();
  p.first_turn = d.first_turn.empty() ? nullptr : d.first_turn.data();
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
  p.flag_lock = flag::gimbal_lock;
  p.flag_stepped = flag::load_stepped;
  p.flag_unverified = flag::branch_unverified;
  p.flag_slack = flag::slack;
  p.near_lock = near_lock;
  p.narrow = narrow_in_lanes;
  p.length = m.length;
  p.stiffness = m.stiffness;
  p.softest = softest(m);
  p.bends =
      std::any_of(m.laws.begin(), m.laws.end(), [](const Law& law) { return law.has_knots(); }) &&
      std::none_of(m.laws.begin(), m.laws.end(), [](const Law& law) { return law.sticks() || law.friction() != 0; }) &&
      std::none_of(d.coordinates.begin(), d.coordinates.end(), [](const auto& c) { return c.friction != 0; });
  for (const Op& op : d.ops) p.parallel |= op.kind == OpKind::block && op.count > 1;
}

/// What a redundant machine's closure stays near to; false where the kernels close it in no lane: a leg with loops, or
/// with many joints.
bool link_nearness(const Mechanism& m, FastPlanData& d) {
  constexpr int most_joints = 16;  // as nearest.hpp of the kernels
  if (d.program.closes != 1) return false;
  for (const LegClosure& leg : d.legs)
    if (leg.equations != 1 || leg.unknowns > most_joints) return false;
  for (const std::int32_t j : d.unknowns) d.nearness.push_back(m.nearness[j]);
  d.program.nearness = d.nearness.data();
  return true;
}

/// The program of what hangs: all numbers are those of `d.program`, which is complete.
void link_hanging(FastPlanData& d) {
  Program& p = d.program;
  p.spins = d.spins.data();
  p.spin_count = i32(d.spins.size());
  d.hanging = p;
  d.hanging.ops = d.hanging_ops.data();
  if (std::all_of(d.spins.begin(), d.spins.end(), [](const SpinProgram& s) { return s.heavy; }))
    d.hanging.flag_always &= ~flag::free_spin;
  p.hanging = &d.hanging;
}

}  // namespace

FastPlan::FastPlan(const Mechanism& m, const Vec3& low, const Vec3& high, int grid_nodes)
    : data_(std::make_unique<FastPlanData>()) {
  for (const NodeSpring& s : m.external_springs) {
    const FromTip tip = from_tip(m, s.node);
    if (!tip.rigid) missing_ = "external springs that are not at the tip";
    else data_->springs.push_back(tip_spring(s, tip));
  }
  const CompiledChains chains = compile_chains(m, *data_);
  if (missing_.empty()) missing_ = chains.missing;
  find_serial(m, *data_);
  data_->program.deficient = is_deficient(m, *data_);
  if (data_->program.deficient) data_->program.flag_always |= flag::rigid_direction;
  else if (missing_.empty() && m.floating) missing_ = fill_floating(m, *data_);
  else if (missing_.empty() && chains.deficient)
    missing_ = "a chain with neither a full link spring nor six joints that yield";
  if (data_->program.legs_op < 0 && !m.floating) missing_ = "no legs";
  if (m.size() == 0) missing_ = "no joint and no spring";
  if (missing_.empty() && m.beside_home.size() > 0) missing_ = "hinges that do not lock at home";
  if (!missing_.empty()) return;
  const Spins spins(m);
  heavy_spins_ = spins.heavy();
  fill_tables(m, chains, *data_);
  compile_places(m, chains, *data_);
  const bool box = (high - low).minCoeff() >= 0 && high.allFinite();
  const bool leg_by_leg =
      !m.floating && m.task == full_task && only_legs_have_joints(m, *data_) && compile_closure(m, *data_);
  if (leg_by_leg) recognise_planar_legs(m, *data_);
  if (leg_by_leg) recognise_arm(m, *data_);
  if (leg_by_leg) bound_reach(m, *data_);
  const bool whole = !m.floating && !leg_by_leg && box && compile_whole_closure(m, *data_);
  link(m, *data_);
  Program& p = data_->program;
  for (std::size_t i = 0; i < 6; ++i) p.task[i] = m.task[i];
  for (int i = 0; i < 3; ++i) p.home_p[i] = m.home.p[i];
  for (int i = 0; i < 9; ++i) p.home_R[i] = m.home.R(i % 3, i / 3);
  p.open_task = m.task != full_task;
  p.closes = m.floating ? (m.task == full_task ? 1 : 0) : leg_by_leg && (box || p.planar) ? 1 : whole ? 2 : 0;
  if (p.unknown_count == 0 && !m.floating) p.closes = 0;  // a structure stands at home alone
  if (m.redundancy > 0 && !link_nearness(m, *data_)) p.closes = 0;
  if (p.closes && !p.planar && !m.floating) place_grid(m, low, high, grid_nodes, *data_);
  if (heavy_spins_ && !p.deficient && let_spins_hang(m, spins, *data_)) link_hanging(*data_);
}

bool FastPlan::nearest_start(const Mechanism& m, const Vec3& position, VecX& x) const {
  const Program& p = data_->program;
  if (!p.grid) return false;
  std::size_t node = 0, stride = 1;
  for (int k = 0; k < 3; ++k) {
    const double u = (position[k] - p.grid_low[k]) / p.grid_step[k];
    const double beyond = p.grid_n[k] > 1 ? 1e-9 : 0.5;
    if (!(u >= -beyond && u <= p.grid_n[k] - 1 + beyond)) return false;
    const double i = std::clamp(std::round(u), 0.0, p.grid_n[k] - 1.0);
    node += static_cast<std::size_t>(i) * stride;
    stride *= static_cast<std::size_t>(p.grid_n[k]);
  }
  x = m.home_coordinates;
  const double* g = p.grid + node * static_cast<std::size_t>(p.grid_row);
  for (std::size_t j = 0; j < data_->unknowns.size(); ++j) x[data_->unknowns[j]] = g[j];
  return x.allFinite();
}

bool FastPlan::hangs(Index coordinate) const {
  const auto here = [coordinate](const SpinProgram& s) { return s.heavy && s.held == coordinate; };
  return std::any_of(data_->spins.begin(), data_->spins.end(), here);
}

FastPlan::~FastPlan() = default;

const Program& FastPlan::program() const { return data_->program; }

}  // namespace stiffmap
