#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// σ of projection over the image as a function of the covariance of the free lens parameters, linear in it: what is
/// evaluated for hundreds of photos that might be taken. As projection_sigma() at infinity, with the weights of the
/// implied motion fixed at those of the covariance that the camera has.
class SigmaMap {
 public:
  SigmaMap(const Camera& camera, const std::vector<int>& free, int cols, int rows);

  struct Summary {
    double worst_px = 0.0, rms_px = 0.0;  ///< Of σ.
    std::size_t at = 0;                   ///< Where the worst is.
  };
  [[nodiscard]] Summary of(const Eigen::MatrixXd& cov) const;
  [[nodiscard]] Eigen::Vector2d px(std::size_t at) const { return pixels_[at]; }

 private:
  std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic>> derivatives_;
  std::vector<Eigen::Vector2d> pixels_;
};

}  // namespace alidade
