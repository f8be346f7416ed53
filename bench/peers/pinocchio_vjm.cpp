// SPDX-License-Identifier: MIT
/* Virtual joint method by hand in C++ on Pinocchio and Eigen: the case of tripteron.py, one thread.

Stiffness without load (a 9x9 system for each leg), and equilibrium with stiffness under a load (Newton's method on a
60x60 system, geometric part in closed form). Build, two minutes (-w: warnings of Pinocchio itself), and run:

  pip install pin cmeel-eigen
  P=$(python -c 'import pinocchio; print(pinocchio.__file__.rpartition("/lib/python")[0])')
  g++ -w -std=c++17 -O3 -march=native -DNDEBUG -DBOOST_MPL_LIMIT_LIST_SIZE=30 \
      -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -I$P/include -I$P/include/eigen3 \
      bench/peers/pinocchio_vjm.cpp -o vjm -L$P/lib -lpinocchio_default -Wl,-rpath,$P/lib
  python bench/scoreboard.py --out docs/scoreboard.md --speed ./vjm
*/
#include <pinocchio/multibody.hpp>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/spatial.hpp>
#include <random>
#include <vector>
namespace pin = pinocchio;
using namespace Eigen;
using V3 = Vector3d;
using M3 = Matrix3d;
using V6 = Matrix<double, 6, 1>;
using V16 = Matrix<double, 16, 1>;
using J16 = Matrix<double, 6, 16>;
using M16 = Matrix<double, 16, 16>;
constexpr double L = .75, D = .15, E = 7e10, G = 2.55e10, KA = 1e6, S = .9;
const double PI = std::acos(-1.);
M3 Rx(double a) { return AngleAxisd(a, V3::UnitX()).toRotationMatrix(); }
M3 Ry(double a) { return AngleAxisd(a, V3::UnitY()).toRotationMatrix(); }
M3 Rz(double a) { return AngleAxisd(a, V3::UnitZ()).toRotationMatrix(); }
struct Base {
  M3 R;
  V3 o;
};
const Base BASES[3] = {{M3::Identity(), V3::Zero()}, {Ry(PI / 2) * Rz(PI), V3(0, S, 0)}, {Rx(-PI / 2), V3(0, 0, S)}};
Matrix<double, 6, 6> ktip() {
  double A = PI * D * D / 4, I = PI * D * D * D * D / 64, Jp = 2 * I;
  Matrix<double, 6, 6> K = Matrix<double, 6, 6>::Zero();
  K.diagonal() << E * A / L, 12 * E * I / (L * L * L), 12 * E * I / (L * L * L), G * Jp / L, 4 * E * I / L,
      4 * E * I / L;
  K(1, 5) = K(5, 1) = -6 * E * I / (L * L);
  K(2, 4) = K(4, 2) = 6 * E * I / (L * L);
  return K;
}
const int IT[13] = {0, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13, 14}, IQ[3] = {1, 8, 15};
struct Leg {
  pin::Model m;
  pin::Data d;
  pin::FrameIndex f;
  M3 R;
  V3 o;
};
Leg build(int i) {
  Leg g;
  g.R = BASES[i].R;
  g.o = BASES[i].o;
  pin::JointIndex j = 0;
  pin::SE3 I4 = pin::SE3::Identity(), TL(M3::Identity(), V3(L, 0, 0));
  int n = 0;
  auto add = [&](auto c, const pin::SE3& M) { j = g.m.addJoint(j, c, M, "j" + std::to_string(n++)); };
  add(pin::JointModelPZ(), pin::SE3(g.R, g.o));
  add(pin::JointModelRZ(), I4);
  for (int k = 0; k < 2; k++) {
    add(pin::JointModelPX(), TL);
    add(pin::JointModelPY(), I4);
    add(pin::JointModelPZ(), I4);
    add(pin::JointModelRX(), I4);
    add(pin::JointModelRY(), I4);
    add(pin::JointModelRZ(), I4);
    add(pin::JointModelRZ(), I4);
  }
  g.f = g.m.addFrame(pin::Frame("tip", j, 0, pin::SE3(M3(g.R.transpose()), V3::Zero()), pin::OP_FRAME));
  g.d = pin::Data(g.m);
  return g;
}
std::vector<Leg> LEGS;
Matrix<double, 13, 13> KT, KTI;
M16 KF;
V16 q_of(const V3& p, int i) {
  V3 l = BASES[i].R.transpose() * (p - BASES[i].o);
  double x = l[0], y = l[1], z = l[2], c2 = (x * x + y * y - 2 * L * L) / (2 * L * L),
         q2 = std::atan2(std::sqrt(1 - c2 * c2), c2), c = std::hypot(x, y), ck = c / (2 * L),
         kk = std::atan2(std::sqrt(1 - ck * ck), ck), q1 = std::atan2(y, x) - kk;
  V16 v = V16::Zero();
  v[0] = z;
  v[1] = q1;
  v[8] = q2;
  v[15] = -q1 - q2;
  return v;
}
void jac(Leg& g, const V16& q, J16& J) {
  pin::computeJointJacobians(g.m, g.d, q);
  pin::updateFramePlacement(g.m, g.d, g.f);
  J.setZero();
  pin::getFrameJacobian(g.m, g.d, g.f, pin::LOCAL_WORLD_ALIGNED, J);
}
Matrix<double, 6, 6> unloaded(const V3& p) {
  Matrix<double, 6, 6> K = Matrix<double, 6, 6>::Zero();
  J16 J;
  for (int i = 0; i < 3; i++) {
    jac(LEGS[i], q_of(p, i), J);
    Matrix<double, 6, 3> Jq;
    Matrix<double, 6, 13> Jt;
    for (int k = 0; k < 3; k++) Jq.col(k) = J.col(IQ[k]);
    for (int k = 0; k < 13; k++) Jt.col(k) = J.col(IT[k]);
    Matrix<double, 9, 9> M = Matrix<double, 9, 9>::Zero();
    M.topLeftCorner<6, 6>() = Jt * KTI * Jt.transpose();
    M.topRightCorner<6, 3>() = Jq;
    M.bottomLeftCorner<3, 6>() = Jq.transpose();
    K += M.inverse().topLeftCorner<6, 6>();
  }
  return K;
}
struct Ans {
  V6 t;
  Matrix<double, 6, 6> K;
  int it;
};
using M60 = Matrix<double, 60, 60>;
using V60 = Matrix<double, 60, 1>;
Ans loaded(const V3& p, const V6& W) {
  V16 x0[3], x[3];
  for (int i = 0; i < 3; i++) x[i] = x0[i] = q_of(p, i);
  Matrix<double, 12, 1> lam = Matrix<double, 12, 1>::Zero();
  static M60 N;
  V60 res;
  J16 J[3];
  int it;
  PartialPivLU<M60> lu;
  for (it = 0; it < 20; it++) {
    N.setZero();
    V6 F[3] = {W - lam.head<6>() - lam.tail<6>(), lam.head<6>(), lam.tail<6>()};
    double em = 0, rm = 0;
    for (int i = 0; i < 3; i++) {
      jac(LEGS[i], x[i], J[i]);
      V3 f = F[i].head<3>(), m = F[i].tail<3>();
      M16 H;
      for (int a = 0; a < 16; a++) {
        V3 va = J[i].col(a).head<3>(), wa = J[i].col(a).tail<3>();
        for (int k = 0; k <= a; k++) {
          V3 wk = J[i].col(k).tail<3>();
          H(a, k) = f.dot(wk.cross(va)) + m.dot(wk.cross(wa));
        }
        for (int k = a + 1; k < 16; k++) H(a, k) = f.dot(wa.cross(V3(J[i].col(k).head<3>())));
      }
      res.segment<16>(16 * i) = KF * (x[i] - x0[i]) - J[i].transpose() * F[i];
      N.block<16, 16>(16 * i, 16 * i) = KF - H.transpose();
    }
    for (int c = 0; c < 2; c++) {
      int i = c + 1;
      const pin::SE3 &T = LEGS[i].d.oMf[LEGS[i].f], &T0 = LEGS[0].d.oMf[LEGS[0].f];
      V6 e;
      e.head<3>() = T.translation() - T0.translation();
      e.tail<3>() = pin::log3(M3(T.rotation() * T0.rotation().transpose()));
      res.segment<6>(48 + 6 * c) = -e;
      em = std::max(em, e.cwiseAbs().maxCoeff());
      N.block<16, 6>(0, 48 + 6 * c) = J[0].transpose();
      N.block<16, 6>(16 * i, 48 + 6 * c) = -J[i].transpose();
    }
    N.bottomLeftCorner<12, 48>() = N.topRightCorner<48, 12>().transpose();
    rm = res.cwiseAbs().maxCoeff();
    if (it && rm < 1e-6 && em < 1e-12) break;
    lu.compute(N);
    V60 dx = lu.solve(-res);
    for (int i = 0; i < 3; i++) x[i] += dx.segment<16>(16 * i);
    lam += dx.tail<12>();
  }
  lu.compute(N);
  Matrix<double, 60, 6> B = Matrix<double, 60, 6>::Zero();
  B.topRows<16>() = J[0].transpose();
  Matrix<double, 6, 6> C = B.transpose() * lu.solve(B);
  Ans a;
  a.t.head<3>() = LEGS[0].d.oMf[LEGS[0].f].translation() - p;
  a.t.tail<3>() = pin::log3(M3(LEGS[0].d.oMf[LEGS[0].f].rotation()));
  a.K = C.inverse();
  a.it = it;
  return a;
}
double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }
int main(int argc, char** argv) {
  for (int i = 0; i < 3; i++) LEGS.push_back(build(i));
  KT.setZero();
  KT(0, 0) = KA;
  KT.block<6, 6>(1, 1) = ktip();
  KT.block<6, 6>(7, 7) = ktip();
  KTI = KT.inverse();
  KF.setZero();
  for (int a = 0; a < 13; a++)
    for (int b = 0; b < 13; b++) KF(IT[a], IT[b]) = KT(a, b);
  V6 W;
  W << 0, 0, 1000, 0, 0, 0;
  {
    V3 p(.3, .4, .5);
    V6 w;
    w << 0, 0, 100, 0, 0, 0;
    V6 u = unloaded(p).ldlt().solve(w);
    Ans a = loaded(p, w);
    std::printf("unloaded |d| %.6e (1.161353e-4) loaded %.9e it %d\n", u.head<3>().norm(), a.t.head<3>().norm(), a.it);
  }
  std::mt19937 r(5);
  std::uniform_real_distribution<double> U(.2, .6);
  std::vector<V3> P(4000);
  for (auto& p : P) p = V3(U(r), U(r), U(r));
  double s = 0;
  double bu = 1e9, bl = 1e9;
  for (int k = 0; k < 7; k++) {
    double t = now();
    for (auto& p : P) s += unloaded(p)(0, 0);
    bu = std::min(bu, (now() - t) / P.size());
    t = now();
    int n = P.size() / 8;
    for (int i = 0; i < n; i++) s += loaded(P[i], W).K(0, 0);
    bl = std::min(bl, (now() - t) / n);
  }
  std::printf("C++ Pinocchio + Eigen, one thread: unloaded %.2f us, loaded (1 kN) %.2f us  [%g]\n", bu * 1e6, bl * 1e6,
              s);
}
