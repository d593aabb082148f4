#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

namespace alidade {

/// Covariance of a state of changing size, and the low-rank change by the measurements of one instant: P − W Wᵀ, with
/// W = P Hᵀ L⁻ᵀ and L Lᵀ = S; it is symmetric by construction. Measurements append columns to W one after another;
/// commit() applies them all to P in one pass, so that the large matrix is read and written once per frame. Nothing is
/// allocated after reserve(). Reserved memory is not written before it is needed, and a copy copies only what is in
/// use: most of the room for a large map is never used.
class StateCovariance {
 public:
  static constexpr int panel = 8;         ///< Rows that are processed together.
  static constexpr int max_columns = 32;  ///< Of one call of products(): components measured together.
  static constexpr int max_support = 35;  ///< State components that one measurement depends on.

  StateCovariance() = default;
  ~StateCovariance() = default;
  StateCovariance(const StateCovariance& other) { *this = other; }
  StateCovariance(StateCovariance&&) noexcept = default;
  StateCovariance& operator=(const StateCovariance& other);
  StateCovariance& operator=(StateCovariance&&) noexcept = default;

  /// Reserves room for that many state components, and for that many measured ones between two commits.
  void reserve(int state_capacity, int measured_capacity);
  [[nodiscard]] int dim() const { return dim_; }
  [[nodiscard]] int capacity() const { return stride_; }
  [[nodiscard]] int num_pending() const { return pending_; }
  [[nodiscard]] int measured_capacity() const { return pending_capacity_; }

  /// An entry of P, without the pending change.
  [[nodiscard]] double& at(int i, int j) {
    return P_[static_cast<std::size_t>(j) * stride() + static_cast<std::size_t>(i)];
  }
  [[nodiscard]] double at(int i, int j) const {
    return P_[static_cast<std::size_t>(j) * stride() + static_cast<std::size_t>(i)];
  }
  [[nodiscard]] const double* column(int j) const { return &P_[static_cast<std::size_t>(j) * stride()]; }
  /// An entry of P − W Wᵀ.
  [[nodiscard]] double current(int i, int j) const;

  /// Appends state components, uncorrelated with the others and with zero variance. False if there is no room.
  [[nodiscard]] bool grow(int count);
  /// Removes `count` components from `offset` on.
  void remove(int offset, int count);

  /// Two measured components that depend on the state components `columns`, and their derivatives h0, h1.
  struct Rows {
    std::span<const int> columns;
    const double *h0, *h1;
  };
  /// X = (P − W Wᵀ) Hᵀ for all state rows; 2 columns for each of `rows`.
  void products(std::span<const Rows> rows);
  /// The same without W, into buffers of the caller (dim() components each, rounded up to whole panels).
  void product(const Rows& rows, double* x0, double* x1) const;
  /// H (P − W Wᵀ) Hᵀ.
  [[nodiscard]] Eigen::Matrix2d innovation_covariance(const Rows& rows) const;
  [[nodiscard]] double product_at(int i, int column) const {
    return X_[static_cast<std::size_t>((i / panel * max_columns + column) * panel + i % panel)];
  }
  /// Appends X · `M` (num × num, row-major, upper triangular: L⁻ᵀ) to the pending W. False if W is full.
  [[nodiscard]] bool append(std::span<const double> M, int num);
  /// Discards the pending change from column `count` on.
  void drop_pending(int count = 0) { pending_ = count; }
  /// Swaps the pending change and the one set aside: two updates can be tried from one prior.
  void swap_pending();
  /// Whether every variance stays positive with the pending change.
  [[nodiscard]] bool stays_positive() const;
  /// P ← P − W Wᵀ.
  void commit();
  /// P ← B P Bᵀ with B block-diagonal of 3 × 3 blocks, stacked in `blocks` (capacity() × 3, column-major); the
  /// `num_single` components from `single_at` on stay as they are.
  void turn(const double* blocks, int single_at, int num_single);
  /// P ← (I + K E) P (I + K E)ᵀ, where E selects the three components from `at` on; K: capacity() × 3, column-major.
  void shear(int at, const double* K);
  /// P ← (I + u E) P (I + u E)ᵀ, where E selects the component `at`; u: dim() components.
  void shear_along(int at, const double* u);

 private:
  [[nodiscard]] std::size_t stride() const { return static_cast<std::size_t>(stride_); }
  [[nodiscard]] int num_panels() const { return (dim_ + panel - 1) / panel; }
  void mirror_lower();  ///< Copies the lower triangle to the upper one.

  int dim_ = 0, stride_ = 0, pending_ = 0, pending_aside_ = 0, pending_capacity_ = 0;
  std::unique_ptr<double[]> P_;            ///< Column-major; zero up to the end of the last panel.
  std::unique_ptr<double[]> W_, W_aside_;  ///< Panel by panel, column-major within it, 8 rows each.
  std::vector<double> X_;                  ///< The same layout, max_columns.
  std::vector<double> HW_;
  std::vector<double> shear_;  ///< Work space of shear(): capacity() × 3.
};

}  // namespace alidade
