// SPDX-License-Identifier: MIT
// Factorisations of dense matrices. They take minutes to compile, so that only dense.cpp and eigenvalues.cpp do.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>

#include "stiffmap/algebra/types.hpp"

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
  /// Orthonormal, of the matrix that was decomposed.
  MatX null_vectors() const;

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
/// X' A X of a matrix that has many zeros.
MatX congruent(const MatX& A, const MatX& X);

/// Orthonormal vectors x with A'x = 0, by pivoted QR of A.
MatX left_null_vectors(const MatX& A, double threshold);

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
/// Of any square matrix, in no order; vectors of length one.
struct ComplexEigen {
  Eigen::VectorXcd values;
  Eigen::MatrixXcd vectors;
};
ComplexEigen general_eigen(const MatX& A);

/// Cholesky factor in place below the diagonal; false where the matrix is not positive definite.
bool cholesky(MatX& A);

/// Cholesky factorisation L L' of a symmetric matrix, given below its diagonal.
class Cholesky {
 public:
  /// False where the matrix is not positive definite.
  bool compute(const MatX& A);
  /// Diagonal of L.
  auto pivots() const { return llt_.matrixLLT().diagonal(); }
  void solve(const VecX& b, VecX& x) const;
  void solve(const MatX& B, MatX& X) const;
  /// L^-1 B and L'^-1 B, in place.
  void solve_lower(MatX& B) const;
  void solve_upper(MatX& B) const;

 private:
  Eigen::LLT<MatX> llt_;
};

}  // namespace stiffmap
