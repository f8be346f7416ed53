// SPDX-License-Identifier: MIT
#include "chains.hpp"

#include <algorithm>

#include "stiffmap/algebra/dense.hpp"
#include "stiffmap/model/whole_branches.hpp"

namespace stiffmap {
namespace {

constexpr int most_prefix = 16;

/// Walks the chains in the order in which Mechanism numbered their coordinates.
class Compiler {
 public:
  Compiler(const Mechanism& m, FastPlanData& out) : m_(m), out_(out) {}

  CompiledChains run() {
    out_.chains.emplace_back();
    out_.program.root = 0;
    out_.program.legs_op = -1;
    chain(m_.description, 0, true, true);
    return std::move(found_);
  }

 private:
  struct Way {  // what has been passed since the chain's start
    Pose nominal, actual;
    bool rigid = true;
    int prefix = 0;
  };

  /// Operations of a chain are contiguous: those of its branches come before them.
  void chain(const Chain& c, std::size_t index, bool outermost, bool still) {
    std::vector<Op> ops;
    Way way;
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
        block(*k, way, ops, outermost, still);
      } else if (const auto* p = std::get_if<Point>(&element)) {
        const Pose at{p->offset, Mat3::Identity()};
        found_.places.push_back({index, ops.size(), way.nominal * at, way.actual * at});
      }
    }
    ChainProgram& p = out_.chains[index];
    p.first = i32(out_.ops.size());
    p.count = i32(ops.size());
    p.nominal = constant(way.nominal);
    p.actual = constant(way.actual);
    p.still = still;
    p.first_stiff = -1;
    for (std::size_t i = 0; i < ops.size(); ++i)
      if (p.first_stiff < 0 && (ops[i].kind == OpKind::spring || ops[i].kind == OpKind::block))
        p.first_stiff = p.first + i32(i);
    p.group = -1;
    if (p.first_stiff < 0) first_group(p, ops);
    if (outermost && out_.program.legs_op >= 0) out_.program.legs_op += p.first;
    out_.ops.insert(out_.ops.end(), ops.begin(), ops.end());
  }

  /// A chain without spring or block starts with its first six joints together (docs/fast_path.md F12).
  void first_group(ChainProgram& p, const std::vector<Op>& ops) {
    int joints = 0;
    for (std::size_t i = 0; i < ops.size(); ++i) {
      if (ops[i].kind > OpKind::prismatic || !ops[i].eliminated || p.first_stiff >= 0) continue;
      if (++joints < 6) continue;
      p.first_stiff = p.first + i32(i);
      p.group = out_.program.group_slots++;
    }
    found_.deficient |= p.group < 0;
  }

  Op& push(OpKind kind, Way& way, std::vector<Op>& ops) {
    Op op{};
    op.kind = kind;
    op.coordinate = op.law = op.wrench = op.stroke = -1;
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
    if (j.actuated) found_.drives.push_back({op.coordinate, op.slot, j.type == JointType::prismatic});
    if (op.eliminated && way.rigid && ++way.prefix > most_prefix)
      found_.missing = "more joints before the first link spring than are supported";
    for (const GuideError& e : j.guide_errors) guide_error(e, way, ops);
  }

  /// A slide that only its error moves.
  void guide_error(const GuideError& e, Way& way, std::vector<Op>& ops) {
    Op& op = push(OpKind::prismatic, way, ops);
    op.coordinate = next_++;
    op.slot = out_.program.joint_slots++;
    op.axis = 3;
    for (int i = 0; i < 3; ++i) op.direction[i] = e.axis[i];
  }

  /// A spring that is full and regular is one operation, and so is one with laws that always yield; one with
  /// uncoupled directions, some of them rigid, free or stuck, is a sequence of elastic joints.
  void spring(const Spring& s, Way& way, std::vector<Op>& ops) {
    Mat6 K = s.matrix.stiffness, whole = K;
    bool sticks = false;
    for (const auto& [i, law] : s.laws) {
      sticks = sticks || law.sticks();
      K(i, i) = 0;
      whole(i, i) = law.stiffness();
    }
    const Vec6 d = whole.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const bool deficient = s.matrix.rotated || s.matrix.rigid.any() ||
                           symmetric_eigen(Mat6(d.asDiagonal() * whole * d.asDiagonal())).values[0] < 1e-9;
    if (deficient || sticks) {
      if (s.stroke) found_.missing = "a link spring with rigid or free directions that varies with a joint";
      if (s.matrix.rotated || !Mat6(K.diagonal().asDiagonal()).isApprox(K, 1e-14))
        found_.missing = "a coupled link spring with rigid, free or stuck directions";
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
    if (s.stroke) {
      op.stroke = 0;                                                  // numbered once all operations are known
      if (!s.stroke->table.empty()) std::fill(op.K, op.K + 36, 1.0);  // any entry may be there somewhere
    }
    way.rigid = false;
  }

  void elastic_joints(const Spring& s, const Mat6& K, Way& way, std::vector<Op>& ops) {
    for (int i = 0; i < 6; ++i, ++next_) {
      const Index law = m_.coordinates[static_cast<std::size_t>(next_)].law;
      const bool rigid = s.matrix.rigid[i] && law < 0;  // a law makes a rigid direction yield
      if (rigid && s.rest[i] == 0) continue;
      Op& op = push(i < 3 ? OpKind::prismatic : OpKind::revolute, way, ops);
      op.coordinate = next_;
      op.eliminated = !rigid;
      op.slot = out_.program.joint_slots++;
      op.axis = i % 3;
      op.direction[i % 3] = 1;
      op.law = i32(law);
      if (rigid) continue;
      found_.elastic.push_back({next_, K(i, i), s.rest[i]});
      if (way.rigid && ++way.prefix > most_prefix)
        found_.missing = "more joints before the first link spring than are supported";
    }
  }

  void body(const Body& b, Way& way, std::vector<Op>& ops) {
    if (b.mass == 0) return;
    Op& op = push(OpKind::load, way, ops);
    op.slot = out_.program.joint_slots++;
    op.mass = b.mass;
    for (int i = 0; i < 3; ++i) op.com[i] = b.com[i];
  }

  void block(const Block& b, Way& way, std::vector<Op>& ops, bool outermost, bool still) {
    if (b.branches.empty()) return;  // no leg
    const std::size_t first = out_.chains.size();
    out_.chains.resize(first + b.branches.size());
    const bool is_legs = outermost && b.name == "legs" && out_.program.legs_op < 0;
    const int here = i32(ops.size());
    for (const Op& before : ops) still = still && before.kind == OpKind::load;
    Op& op = push(OpKind::block, way, ops);
    op.first = i32(first);
    op.count = i32(b.branches.size());
    op.slot = out_.program.stiff_slots++;
    for (std::size_t k = 0; k < b.branches.size(); ++k) chain(b.branches[k].second, first + k, false, still);
    if (is_legs) out_.program.legs_op = here;
    way.rigid = false;
  }

  const Mechanism& m_;
  FastPlanData& out_;
  std::int32_t next_ = 0;
  CompiledChains found_;
};

}  // namespace

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

CompiledChains compile_chains(const Mechanism& m, FastPlanData& out) { return Compiler(m, out).run(); }

}  // namespace stiffmap
