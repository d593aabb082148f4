#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace alidade {

/// Second derivatives of a map of the plane: ∂²/∂x², ∂²/∂x∂y, ∂²/∂y² in the columns. [1/px]
using WarpBend = Eigen::Matrix<double, 2, 3>;

/// Positions of a point in two frames.
struct PointMove {
  Eigen::Vector2d from_px, to_px;
};

/// A smooth map of one whole image to another: a cubic polynomial fitted to many moved points. Models the curvature by
/// perspective under rotation, and by the lens. For a distant scene this suffices with any lens.
class ImageWarp {
 public:
  /// Empty for too few points. Points that moved differently from the rest are rejected.
  [[nodiscard]] static std::optional<ImageWarp> fit(std::span<const PointMove> moves);

  [[nodiscard]] Eigen::Vector2d at(const Eigen::Vector2d& px) const;
  [[nodiscard]] WarpBend bend_at(const Eigen::Vector2d& px) const;

 private:
  static constexpr int num_terms = 10;
  using Terms = Eigen::Matrix<double, num_terms, 1>;

  [[nodiscard]] Eigen::Vector2d normalised(const Eigen::Vector2d& px) const { return (px - centre_) / scale_; }
  [[nodiscard]] static Terms terms(const Eigen::Vector2d& q);
  [[nodiscard]] bool solve(std::span<const PointMove> moves, double max_residual_px);

  Eigen::Vector2d centre_ = Eigen::Vector2d::Zero();
  double scale_ = 1.0;
  Eigen::Matrix<double, num_terms, 2> coefficients_ = Eigen::Matrix<double, num_terms, 2>::Zero();
};

}  // namespace alidade
