// SPDX-License-Identifier: MIT
// Rows of plain numbers in, one for each pose; arrays by name out, each with the pose as its leading axis.
#pragma once

#include <list>
#include <string>
#include <variant>
#include <vector>

#include "stiffmap/algebra/types.hpp"
#include "stiffmap/common/check.hpp"

namespace stiffmap {

using RowX = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Rows = Eigen::Map<const RowX>;  ///< a row for each pose; without rows where nothing is given

/// Refuses what is not `width` numbers for each of `count` poses, or nothing where that is `enough`.
inline void check_rows(const Rows& given, const std::string& name, Index count, Index width, bool enough = false) {
  const bool nothing = given.rows() == 0 && (enough || count == 0);
  const std::string wanted = std::to_string(count) + " rows of " + std::to_string(width) + " numbers";
  require(nothing || (given.rows() == count && given.cols() == width), name, wanted,
          std::to_string(given.rows()) + " of " + std::to_string(given.cols()));
}

/// A matrix for each pose, by rows; one column where an answer is a vector.
class Blocks {
 public:
  Blocks(double* numbers, Index rows, Index columns) : numbers_(numbers), rows_(rows), columns_(columns) {}
  Eigen::Map<RowX> operator()(Index pose) const { return {numbers_ + pose * rows_ * columns_, rows_, columns_}; }

 private:
  double* numbers_;
  Index rows_, columns_;
};

/// The answers of one call.
class Answers {
 public:
  /// `std::uint8_t` is a yes or no.
  using Values = std::variant<std::vector<double>, std::vector<Status>, std::vector<std::uint8_t>,
                              std::vector<std::int32_t>, std::vector<std::uint32_t>>;
  struct Named {
    std::string name;
    std::vector<Index> shape;  ///< poses first
    Values values;
  };

  explicit Answers(Index poses) : poses_(poses) {}

  /// Numbers of this shape for each pose, NaN until they are written.
  Blocks numbers(const std::string& name, const std::vector<Index>& shape) {
    const Index columns = shape.size() > 1 ? shape.back() : 1;
    Index rows = 1;
    for (std::size_t i = 0; i + (shape.size() > 1 ? 1 : 0) < shape.size(); ++i) rows *= shape[i];
    return {add<double>(name, shape, at(rows * columns), nan), rows, columns};
  }

  /// One value for each pose.
  template <class T>
  T* each(const std::string& name, T before) {
    return add<T>(name, {}, 1, before);
  }

  std::list<Named>& all() { return all_; }

 private:
  template <class T>
  T* add(const std::string& name, std::vector<Index> shape, std::size_t size, T before) {
    shape.insert(shape.begin(), poses_);
    all_.push_back({name, std::move(shape), std::vector<T>(at(poses_) * size, before)});
    return std::get<std::vector<T>>(all_.back().values).data();
  }

  Index poses_;
  std::list<Named> all_;
};

}  // namespace stiffmap
