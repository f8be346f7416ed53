// SPDX-License-Identifier: MIT
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "stiffmap/algebra/dense.hpp"

namespace stiffmap {

Singular singular_vectors(const MatX& A) {
  const Eigen::JacobiSVD<MatX> svd(A, Eigen::ComputeFullV);  // BDCSVD is for larger ones, 20 s more to compile
  return {svd.singularValues(), svd.matrixV()};
}

Singular6 singular_vectors(const Mat6& A) {
  const Eigen::JacobiSVD<Mat6> svd(A, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

Eigen6 symmetric_eigen(const Mat6& A) {
  const Eigen::SelfAdjointEigenSolver<Mat6> eigen(A);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

EigenX symmetric_eigen(const MatX& A) {
  const Eigen::SelfAdjointEigenSolver<MatX> eigen(A);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

ComplexEigen general_eigen(const MatX& A) {
  const Eigen::EigenSolver<MatX> eigen(A);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

}  // namespace stiffmap
