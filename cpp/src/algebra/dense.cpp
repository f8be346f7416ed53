// SPDX-License-Identifier: MIT
#include "stiffmap/algebra/dense.hpp"

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

MatX Orthogonal::null_vectors() const {
  return cod_.colsPermutation() * cod_.matrixZ().transpose().rightCols(cod_.cols() - cod_.rank());
}

Index rank_of(const MatX& A, double threshold) {
  Eigen::ColPivHouseholderQR<MatX> qr(A);
  qr.setThreshold(threshold);
  return qr.rank();
}

MatX congruent(const MatX& A, const MatX& X) {
  const MatX transposed = X.transpose();
  MatX product = MatX::Zero(X.cols(), A.rows());  // of A and X, transposed: its columns lie together
  for (Index j = 0; j < A.cols(); ++j)
    for (Index i = 0; i < A.rows(); ++i)
      if (A(i, j) != 0) product.col(i) += A(i, j) * transposed.col(j);
  return transposed * product.transpose();
}

MatX left_null_vectors(const MatX& A, double threshold) {
  Eigen::ColPivHouseholderQR<MatX> qr;
  qr.setThreshold(threshold);
  qr.compute(A);
  const MatX Q = qr.householderQ();
  return Q.rightCols(A.rows() - qr.rank());
}

Mat6 inverse(const Mat6& A) { return A.partialPivLu().inverse(); }

bool cholesky(MatX& A) {
  const Eigen::LLT<Eigen::Ref<MatX>> llt(A);
  return llt.info() == Eigen::Success;
}

bool Cholesky::compute(const MatX& A) {
  llt_.compute(A);
  return llt_.info() == Eigen::Success;
}
void Cholesky::solve(const VecX& b, VecX& x) const { x = llt_.solve(b); }
void Cholesky::solve(const MatX& B, MatX& X) const { X = llt_.solve(B); }
void Cholesky::solve_lower(MatX& B) const { llt_.matrixL().solveInPlace(B); }
void Cholesky::solve_upper(MatX& B) const { llt_.matrixU().solveInPlace(B); }

}  // namespace stiffmap
