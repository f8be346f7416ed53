// SPDX-License-Identifier: MIT
// Factorisations of dense matrices. They take minutes to compile, so that only dense.cpp does.
#pragma once

#include <Eigen/LU>
#include <Eigen/QR>

#include "stiffmap/types.hpp"

namespace stiffmap {

/// LU with partial pivoting of a square matrix.
class Lu {
 public:
  Lu() = default;
  explicit Lu(Index size) : lu_(size) {}
  void compute(const MatX& A);
  void solve(const VecX& b, VecX& x) const;
  void solve(const MatX& B, MatX& X) const;
  auto pivots() const { return lu_.matrixLU().diagonal(); }
  /// Sign of the row exchanges.
  int exchanges() const;

 private:
  Eigen::PartialPivLU<MatX> lu_;
};

/// Rank-revealing complete orthogonal decomposition: solutions of least squares and least norm.
class Orthogonal {
 public:
  Orthogonal() = default;
  Orthogonal(Index rows, Index columns) : cod_(rows, columns) {}
  void compute(const MatX& A, double threshold);
  Index rank() const { return cod_.rank(); }
  void solve(const VecX& b, VecX& x) const;
  void solve(const MatX& B, MatX& X) const;

 private:
  Eigen::CompleteOrthogonalDecomposition<MatX> cod_;
};

/// Singular values, falling, and right singular vectors.
struct Singular {
  VecX values;
  MatX V;
};
Singular singular_vectors(const MatX& A);
Index rank_of(const MatX& A, double threshold);

/// The same of a 6x6, to full relative accuracy.
struct Singular6 {
  Vec6 values;
  Mat6 V;
};
Singular6 singular_vectors(const Mat6& A);
Mat6 inverse(const Mat6& A);

/// Eigenvalues, rising, and eigenvectors of a symmetric matrix.
struct Eigen6 {
  Vec6 values;
  Mat6 vectors;
};
Eigen6 symmetric_eigen(const Mat6& A);
struct EigenX {
  VecX values;
  MatX vectors;
};
EigenX symmetric_eigen(const MatX& A);

/// Cholesky factor in place below the diagonal; false where the matrix is not positive definite.
bool cholesky(MatX& A);

}  // namespace stiffmap
