#pragma once

#include <Eigen/Core>
#include <initializer_list>

#include "alidade/geometry/rigid3.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// A column of numbers, written with a given number of decimals.
struct NumberColumn {
  static constexpr int all_digits = -1;
  std::string name;
  int digits = all_digits;
};

/// Numeric columns of a table, filled row by row, from left to right.
class NumberColumns {
 public:
  NumberColumns(std::initializer_list<NumberColumn> columns);
  /// Appends columns x_m y_m z_m qx qy qz qw of a pose `parent_from_child`.
  NumberColumns& with_pose(const std::string& parent_from_child, int digits = NumberColumn::all_digits);
  /// Appends columns xx xy xz yy yz zz of a covariance, between these two affixes.
  NumberColumns& with_cov(const std::string& before = "cov_", const std::string& after = "_m2");
  NumberColumns& with(std::initializer_list<NumberColumn> columns);

  /// Adds the next cells of a row.
  void add(std::initializer_list<double> values);
  void add(const Eigen::Vector3d& values) { add({values.x(), values.y(), values.z()}); }
  void add_pose(const Rigid3* parent_from_child);  ///< Null: missing values.
  void add_cov(const Eigen::Matrix3d& cov);
  void add_missing(std::size_t num);

  /// Appends these columns to those of the table.
  void append_to(DataTable& table) const;

 private:
  std::vector<NumberColumn> columns_;
  std::vector<std::vector<double>> values_;
  std::size_t next_ = 0;
};

}  // namespace alidade
