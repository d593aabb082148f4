#pragma once

#include <array>
#include <vector>

#include "alidade/calibrate/solve/view_arrays.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// Board points as arrays [m].
struct PointArrays {
  std::vector<double> x, y, z;
};
[[nodiscard]] PointArrays make_arrays(const std::vector<Eigen::Vector3d>& points);

/// The whitened Jacobian of one view and its residual, column by column: rows 0…n−1 are u, rows stride…stride+n−1
/// are v, the rest is zero. Columns: lens parameters, 6 of the pose (right perturbation [translation, rotation]),
/// residual (prediction − observation), zero. The first three pose columns are also the derivative by the board point.
class Columns {
 public:
  static constexpr int max_lens = 16;
  static constexpr int pose = max_lens, residual = pose + 6, bow = residual + 1, zero = bow + 2, count = zero + 1;

  /// Allocates for n corners.
  void resize(std::size_t num_corners);
  [[nodiscard]] std::size_t stride() const { return stride_; }  ///< n rounded up to whole vectors.
  [[nodiscard]] std::size_t num_rows() const { return 2 * stride_; }
  [[nodiscard]] double* operator[](int column) { return &data_[static_cast<std::size_t>(column) * num_rows()]; }
  [[nodiscard]] const double* operator[](int column) const {
    return &data_[static_cast<std::size_t>(column) * num_rows()];
  }

 private:
  std::size_t num_corners_ = 0, stride_ = 0;
  std::vector<double> data_;
};

/// A lens with precomputed values for its inner loop: made once per linearisation.
struct PreparedLens {
  Lens lens;
  double max_radius2 = 0.0;  ///< Brown: squared radius where the radial map folds.
};
[[nodiscard]] PreparedLens prepare(const Lens& lens);

/// Fills `columns` for one view. False if a used corner cannot be projected: the step is then rejected.
[[nodiscard]] bool fill_columns(const PreparedLens& lens, const Rigid3& cam_from_board, const PointArrays& points,
                                const ViewArrays& view, Columns& columns);

/// Residual (prediction − observation) [px] of every corner, not whitened; NaN if it cannot be projected.
[[nodiscard]] std::vector<Eigen::Vector2d> residuals_px(const PreparedLens& lens, const Rigid3& cam_from_board,
                                                        const PointArrays& points, const ViewArrays& view);

/// Columns of the bow: derivative by its two parameters, heights `along_x[i]`, `along_y[i]` of board point i.
void fill_bow_columns(const ViewArrays& view, const std::vector<double>& along_x, const std::vector<double>& along_y,
                      Columns& columns);

/// Upper triangle of AᵀA for the m columns `column` (m a multiple of 4), each of `rows` doubles (a multiple of 4),
/// written row-major to m × m `product`.
void gram(const double* const* column, int m, std::size_t rows, double* product);

}  // namespace alidade
