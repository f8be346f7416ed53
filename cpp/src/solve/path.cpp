// SPDX-License-Identifier: MIT
#include "stiffmap/solve/path.hpp"

#include <algorithm>
#include <cmath>

namespace stiffmap {
namespace {

constexpr int bisections = 36;
constexpr double shortest_share = 1.0 / 16384;  // of the first step
constexpr double continuous = 1e-4;             // of a step's motion: what lies farther apart at one load are two paths
constexpr double sharpest = 0.7;                // cosine of the turn in one step by arc
constexpr double first_sizes[] = {1, 0.5, 0.25, 2, 0.125, 4};  // onto a crossing branch, in steps

/// A branch as it grows: accepts points after locating what happened on the way to them.
class Trace {
 public:
  Trace(Follower& follower, Branch& out) : f_(follower), out_(out) {}

  /// `step(from, share, to)` corrects the point at that share of the present step; `list`: it was asked for. False
  /// where the step leapt to another path: `to` is then the last point of this one.
  template <class Step>
  bool accept(const LoadedState& from, LoadedState& to, double share, bool list, const Step& step) {
    if (from.unstable != to.unstable && !locate(from, to, share, step)) return false;
    if (list) out_.points.push_back(f_.report(to));
    return true;
  }

  std::size_t size() const { return out_.points.size(); }
  std::vector<Crossing> crossings;  ///< bifurcations, in the order of the path

 private:
  Follower& f_;
  Branch& out_;

  template <class Step>
  bool locate(const LoadedState& from, LoadedState& to, double share, const Step& step) {
    double low = 0, high = share;
    LoadedState y = to, last = to, before = from, after = to;
    for (int k = 0; k < bisections; ++k) {
      const double middle = 0.5 * (low + high);
      if (!step(from, middle, y)) break;  // at a singular point, or between two paths
      last = y;
      (y.unstable == from.unstable ? low : high) = middle;
      (y.unstable == from.unstable ? before : after) = y;
    }
    const double left = (high - low) / share;
    if (left > 10 * continuous || f_.apart(before, after) > (continuous + 2 * left) * f_.apart(from, to)) {
      if (!step(from, low, to)) to = from;
      return false;
    }
    Crossing c = f_.critical(last);
    c.at.unstable = c.point.before = from.unstable;
    c.point.after = to.unstable;
    out_.critical.push_back(c.point);
    if (!c.point.limit) crossings.push_back(c);
    return step(from, share, to);  // the linearisation belongs to the accepted point again
  }
};

/// Load or displacement in equal steps, halved where Newton does not trust them.
PathEnd by_control(Follower& f, const PathOptions& o, LoadedState y, Trace& trace) {
  const bool force = o.control == PathControl::force;
  for (int k = 1; k <= o.steps; ++k) {
    const double goal = o.limit * k / o.steps;
    double share = 1;
    for (;;) {
      const double start = force ? y.load : y.along, rest = goal - start;
      const auto step = [&](const LoadedState& from, double s, LoadedState& to) {
        to = from;
        return f.correct({o.control, start + s * rest, {}}, to);
      };
      LoadedState next = y;
      if (!step(y, share, next)) {
        share *= 0.5;
        if (share < shortest_share) return PathEnd::lost;
        continue;
      }
      const bool there = share == 1, stayed = trace.accept(y, next, share, there, step);
      y = next;
      if (there && stayed) break;
      share = stayed ? std::min(1.0, 2 * share) : 0.25 * share;
      if (share < shortest_share) return PathEnd::lost;
    }
  }
  return PathEnd::limit;
}

/// By arc length from a corrected point along its tangent, at most `longest(tangent)` at a time, until `ended`.
template <class Longest, class Ended>
PathEnd by_arc(Follower& f, LoadedState y, VecX tangent, std::size_t most, Trace& trace, const Longest& longest,
               const Ended& ended) {
  double length = longest(tangent);
  while (trace.size() < most) {
    const auto step = [&](const LoadedState& from, double s, LoadedState& to) {
      to = from;
      f.move(to, s * tangent);
      return f.correct({PathControl::arc, 0, tangent}, to);
    };
    LoadedState next = y;
    bool fits = step(y, length, next);
    if (fits && length > 2 * shortest_share * longest(tangent)) fits = f.tangent(tangent).dot(tangent) > sharpest;
    if (!fits) {
      length *= 0.5;
      if (length < shortest_share * longest(tangent)) return PathEnd::lost;
      // the scaling of the next prediction belongs to the last accepted point
      f.correct({PathControl::force, y.load, {}}, y);
      continue;
    }
    const bool stayed = trace.accept(y, next, length, true, step);
    y = next;
    if (const PathEnd end = ended(y); end != PathEnd::not_followed) return end;
    tangent = f.tangent(tangent);
    length = stayed ? std::min(1.5 * length, longest(tangent)) : 0.25 * length;
    if (length < shortest_share * longest(tangent)) return PathEnd::lost;
  }
  return PathEnd::most_points;
}

PathEnd from_rest(Follower& f, const PathOptions& o, const LoadedState& rest, Trace& trace) {
  if (o.control != PathControl::arc) return by_control(f, o, rest, trace);
  VecX tangent = f.tangent(f.load_row());
  if (o.limit < 0) tangent = -tangent;
  const double speed = std::abs(f.along(tangent));
  if (!(speed > 0)) return PathEnd::lost;
  const auto ended = [&](const LoadedState& y) {
    return std::abs(y.along) >= std::abs(o.limit) ? PathEnd::limit : PathEnd::not_followed;
  };
  // No farther than the limit asks for, and no motion beyond the mechanism's length over the steps.
  const auto longest = [&](const VecX& t) { return std::min(std::abs(o.limit) / speed, 1 / f.motion(t)) / o.steps; };
  return by_arc(f, rest, tangent, static_cast<std::size_t>(o.most_points), trace, longest, ended);
}

/// The branch that crosses at a bifurcation: first a step along the mode, then by arc length, the largest
/// motion per step being the mechanism's length over the number of steps.
PathEnd across(Follower& f, const PathOptions& o, const Crossing& c, Trace& trace, Branch& out) {
  LoadedState y = c.at;
  const double first = (o.cross < 0 ? -1.0 : 1.0) / o.steps;
  bool left = false;
  out.points.push_back(f.report_again(c.at));
  for (const double size : first_sizes)
    if ((left = f.leave(c, size * first, y))) break;
  if (!left) return PathEnd::lost;
  out.points.push_back(f.report(y));
  const VecX tangent = f.tangent((first < 0 ? -1 : 1) * c.mode.normalized());
  const bool force = o.control == PathControl::force;
  const auto ended = [&](const LoadedState& at) {
    const double reached = force ? at.load * (o.limit < 0 ? -1 : 1) : std::abs(at.along);
    if (reached >= std::abs(o.limit)) return PathEnd::limit;
    return force && reached <= 0 ? PathEnd::unloaded : PathEnd::not_followed;
  };
  const auto longest = [&](const VecX& t) { return 1 / (o.steps * f.motion(t)); };
  return by_arc(f, y, tangent, static_cast<std::size_t>(20 * o.steps), trace, longest, ended);
}

PathEnd failed(Status s) {
  if (s == Status::unreachable) return PathEnd::unreachable;
  return s == Status::singular ? PathEnd::singular : PathEnd::lost;
}

}  // namespace

PathResult follow_path(const Mechanism& m, const PoseInput& in, const Vec3& direction, const PathOptions& options) {
  PathResult out;
  Follower f(m, m.points[static_cast<std::size_t>(in.read_points.front())], direction);
  LoadedState rest{State(m)};
  const Status status = f.start(in, rest, out.flags);
  if (status != Status::converged) {
    out.path.end = failed(status);
    return out;
  }
  out.path.points.push_back(f.report(rest));
  Trace trace(f, out.path);
  out.path.end = from_rest(f, options, rest, trace);
  const auto number = static_cast<std::size_t>(std::abs(options.cross));
  if (number == 0 || number > trace.crossings.size()) return out;
  Trace branch(f, out.crossing);
  out.crossing.end = across(f, options, trace.crossings[number - 1], branch, out.crossing);
  return out;
}

}  // namespace stiffmap
