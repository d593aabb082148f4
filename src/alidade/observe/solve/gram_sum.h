#pragma once

#include <Eigen/Core>
#include <cmath>

namespace alidade {

/// Σ w Jᵀ J of many J, 2 × n, in batches: the product of two rows alone would be mostly overhead.
class GramSum {
 public:
  /// Adds w Jᵀ J (J 2 × n, w ≥ 0) to the n × n sum, of which only the lower triangle
  /// is written, now or at flush(): until then the sum must stay at its address.
  template <typename Rows>
  void add(const Eigen::MatrixBase<Rows>& J, double weight, Eigen::MatrixXd& sum) {
    if (used_ > 0 && (&sum != sum_ || used_ == batch)) flush();
    sum_ = &sum;
    columns_.resize(J.cols(), batch);
    columns_.template middleCols<2>(used_) = std::sqrt(weight) * J.transpose();
    used_ += 2;
  }

  void flush() {
    if (used_ > 0) sum_->selfadjointView<Eigen::Lower>().rankUpdate(columns_.leftCols(used_));
    used_ = 0;
  }

 private:
  static constexpr Eigen::Index batch = 64;
  Eigen::MatrixXd columns_;  ///< Columns of Jᵀ, each times the square root of its weight.
  Eigen::Index used_ = 0;
  Eigen::MatrixXd* sum_ = nullptr;
};

}  // namespace alidade
