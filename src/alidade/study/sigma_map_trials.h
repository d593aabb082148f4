#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/camera/implied_motion.h"
#include "alidade/study/trial.h"

namespace alidade {

/// Does the σ map of a calibrated camera mean what it says? 5 × 4 pixels from corner to corner: where the found camera
/// sees what the true one sees there, less the pixel, after the rotation that fits best, along the longest axis of the
/// bound's covariance.
class SigmaMapTrials {
 public:
  /// `bound`: covariance of the lens parameters `free` at the truth.
  SigmaMapTrials(Camera truth, const std::vector<int>& free, const Eigen::MatrixXd& bound);

  /// "map_0_0", column and row of the 5 × 4. [px]
  [[nodiscard]] static std::vector<TrialQuantity> quantities();
  /// Appends a value per pixel; one without σ where the found lens is not valid.
  void add(const Camera& found, std::vector<TrialValue>& values) const;

 private:
  [[nodiscard]] std::vector<Eigen::Vector2d> errors_of(const Camera& found) const;

  PixelGrid grid_;
  std::vector<std::optional<detail::GridPoint>> seen_;  ///< By the truth.
  std::vector<double> weights_;                         ///< As the implied rotation has them.
  std::vector<Eigen::Vector2d> axes_;
  std::vector<double> bounds_px_;
};

}  // namespace alidade
