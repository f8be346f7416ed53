// SPDX-License-Identifier: MIT
// How a chain with heavy bodies answers to the turn of its start frame (docs/fast_path.md F9): weights
// keep their direction, so in the frame of the start they turn the other way.
#pragma once

#include "sym6.hpp"

namespace stiffmap::kernel {

/// Energy of a chain: eta·K eta / 2 + eta·G s + s·M s / 2 for a turn s of its start about `start`.
struct Turning {
  V6 G[3];
  S3 M;
  V3 weight, moment;  ///< of all its bodies, about `start`
  V mass;             ///< of them
  V3 lever;           ///< masses times centres, from `start`
  V3 start;

  void clear(const V3& at) {
    for (V6& g : G) g = V6{};
    M = S3{};
    weight = moment = lever = V3{};
    mass = splat(0);
    start = at;
  }
};

inline V component(const V3& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }

/// S -= scale a a^T.
[[gnu::always_inline]] inline void downdate(S3& S, const V3& a, V scale) {
  const V3 b = scale * a;
  S.xx -= b.x * a.x;
  S.yy -= b.y * a.y;
  S.zz -= b.z * a.z;
  S.xy -= b.x * a.y;
  S.xz -= b.x * a.z;
  S.yz -= b.y * a.z;
}

/// A body joins the chain rigidly: the lever arm of its weight about the start.
[[gnu::always_inline]] inline void hang(Turning& t, double mass, const V3& weight, const V3& centre) {
  t.mass += mass;
  t.lever = t.lever + splat(mass) * (centre - t.start);
  add_lever(t.M, splat(-1.0), weight, centre - t.start);
  t.weight = t.weight + weight;
  t.moment = t.moment + cross(centre - t.start, weight);
}

/// The start moves along a rigid part.
inline void restart(Turning& t, const V3& start) {
  add_lever(t.M, splat(-1.0), t.weight, t.start - start);
  t.moment = t.moment + cross(t.start - start, t.weight);
  t.lever = t.lever + t.mass * (t.start - start);
  t.start = start;
}

/// A body joins behind a compliance at point p: its weight turned by -s is a change of the end's wrench.
inline void append_weight(Turning& t, double mass, const V3& weight, const V3& centre, const V3& p) {
  hang(t, mass, weight, centre);
  const V3 w = weight, o{};
  const V3 turned[3] = {{o.x, -w.z, w.y}, {w.z, o.x, -w.x}, {-w.y, w.x, o.x}};
  for (int k = 0; k < 3; ++k) t.G[k] = t.G[k] + V6{turned[k], cross(centre - p, turned[k])};
}

/// A block whose start is the end of this chain: in the frame of the chain's start its weights turn too, and it takes
/// part in the turn of the whole.
inline void append_block(Turning& t, Turning block) {
  const V3 w = block.weight, m = splat(0.5) * block.moment, o{};
  const S3& turn = block.M;
  const V3 force[3] = {{o.x, -w.z, w.y}, {w.z, o.x, -w.x}, {-w.y, w.x, o.x}};
  const V3 follows[3] = {{o.x, -m.z, m.y}, {m.z, o.x, -m.x}, {-m.y, m.x, o.x}};
  const V3 column[3] = {{turn.xx, turn.xy, turn.xz}, {turn.xy, turn.yy, turn.yz}, {turn.xz, turn.yz, turn.zz}};
  for (int k = 0; k < 3; ++k) t.G[k] = t.G[k] + V6{force[k], column[k] + follows[k]};
  restart(block, t.start);
  t.M = t.M + block.M;
  t.weight = t.weight + block.weight;
  t.moment = t.moment + block.moment;
  t.mass += block.mass;
  t.lever = t.lever + block.lever;
}

/// Another reference point of the end, r further.
inline void transport(Turning& t, const V3& r) {
  for (V6& g : t.G) g.b = g.b - cross(r, g.a);
}

/// A coordinate with row u and coupling s to the turn is eliminated; a is its a'/pivot.
inline void eliminate(Turning& t, const V6& u, const V3& s, V a) {
  for (int k = 0; k < 3; ++k) t.G[k] = t.G[k] - (a * component(s, k)) * u;
  downdate(t.M, s, a);
}

/// J·G.
inline V3 along(const Turning& t, const V6& J) { return {dot(J, t.G[0]), dot(J, t.G[1]), dot(J, t.G[2])}; }

/// G w.
inline V6 about(const Turning& t, const V3& w) { return w.x * t.G[0] + w.y * t.G[1] + w.z * t.G[2]; }

}  // namespace stiffmap::kernel
