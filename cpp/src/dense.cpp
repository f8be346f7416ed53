// SPDX-License-Identifier: MIT
#include "stiffmap/dense.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace stiffmap {

void Lu::compute(const MatX& A) { lu_.compute(A); }
void Lu::solve(const VecX& b, VecX& x) const { x.noalias() = lu_.solve(b); }
void Lu::solve(const MatX& B, MatX& X) const { X.noalias() = lu_.solve(B); }
int Lu::exchanges() const { return static_cast<int>(lu_.permutationP().determinant()); }

void Orthogonal::compute(const MatX& A, double threshold) {
  cod_.setThreshold(threshold);
  cod_.compute(A);
}
void Orthogonal::solve(const VecX& b, VecX& x) const { x = cod_.solve(b); }
void Orthogonal::solve(const MatX& B, MatX& X) const { X = cod_.solve(B); }

Singular singular_vectors(const MatX& A) {
  const Eigen::BDCSVD<MatX> svd(A, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

Index rank_of(const MatX& A, double threshold) {
  Eigen::ColPivHouseholderQR<MatX> qr(A);
  qr.setThreshold(threshold);
  return qr.rank();
}

Singular6 singular_vectors(const Mat6& A) {
  const Eigen::JacobiSVD<Mat6> svd(A, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

Mat6 inverse(const Mat6& A) { return A.partialPivLu().inverse(); }

Eigen6 symmetric_eigen(const Mat6& A) {
  const Eigen::SelfAdjointEigenSolver<Mat6> eigen(A);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

EigenX symmetric_eigen(const MatX& A) {
  const Eigen::SelfAdjointEigenSolver<MatX> eigen(A);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

bool cholesky(MatX& A) {
  const Eigen::LLT<Eigen::Ref<MatX>> llt(A);
  return llt.info() == Eigen::Success;
}

}  // namespace stiffmap
