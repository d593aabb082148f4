#include "alidade/results/documents/number_columns.h"

#include <cassert>

namespace alidade {

NumberColumns::NumberColumns(std::initializer_list<NumberColumn> columns) { with(columns); }

NumberColumns& NumberColumns::with(std::initializer_list<NumberColumn> columns) {
  columns_.insert(columns_.end(), columns);
  values_.resize(columns_.size());
  return *this;
}

NumberColumns& NumberColumns::with_pose(const std::string& parent_from_child, int digits) {
  for (const char* part : {"_x_m", "_y_m", "_z_m", "_qx", "_qy", "_qz", "_qw"})
    with({{parent_from_child + part, digits}});
  return *this;
}

NumberColumns& NumberColumns::with_cov(const std::string& before, const std::string& after) {
  for (const char* part : {"xx", "xy", "xz", "yy", "yz", "zz"}) with({{before + part + after}});
  return *this;
}

void NumberColumns::add(std::initializer_list<double> values) {
  for (const double value : values) {
    values_[next_].push_back(value);
    next_ = (next_ + 1) % values_.size();
  }
}

void NumberColumns::add_pose(const Rigid3* parent_from_child) {
  if (parent_from_child == nullptr) return add_missing(7);
  add(parent_from_child->translation);
  const Eigen::Quaterniond& q = parent_from_child->rotation;
  add({q.x(), q.y(), q.z(), q.w()});
}

void NumberColumns::add_cov(const Eigen::Matrix3d& cov) {
  add({cov(0, 0), cov(0, 1), cov(0, 2), cov(1, 1), cov(1, 2), cov(2, 2)});
}

void NumberColumns::add_missing(std::size_t num) {
  for (std::size_t i = 0; i < num; ++i) add({missing_value});
}

void NumberColumns::append_to(DataTable& table) const {
  assert(next_ == 0);
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const bool is_rounded = columns_[i].digits != NumberColumn::all_digits;
    table.columns.emplace_back(columns_[i].name, is_rounded ? rounded(values_[i], columns_[i].digits) : values_[i]);
  }
}

}  // namespace alidade
