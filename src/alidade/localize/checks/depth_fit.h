#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

// depth = offset + g·r + down·R a, for a depth sensor at a in the frame of a camera at r with rotation R, where down =
// g/|g| and |g| is metres per unit of the path; plus optional effects in the readings.

namespace alidade {

/// Model of a depth sensor's readings beside its scale, direction and offset.
struct DepthModel {
  std::span<const DepthReading> readings;
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();  ///< a as given,
  std::optional<double> sigma_arm_m;                ///< and the σ of each coordinate: it is estimated. Empty: exact.
  double jump_s = std::numeric_limits<double>::infinity();  ///< From then on there is another offset.
  int num_drift = 0;         ///< The offset drifts: number of linear pieces of equal duration; at most `most_drift`.
  bool is_arm_free = false;  ///< It is estimated with a very weak prior.
  std::optional<Eigen::Vector3d> g, arm_at;  ///< Initial guess, if an arm makes it nonlinear.

  static constexpr int most_drift = 4;
  [[nodiscard]] bool has_arm() const { return sigma_arm_m || !arm_m.isZero(0.0); }
  [[nodiscard]] int dim() const { return 5 + num_drift + (sigma_arm_m ? 3 : 0); }
};

/// A reading, and the camera's pose at its time.
struct DepthRow {
  double depth_m = 0.0, weight = 1.0;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  double after_jump = 0.0;
  Eigen::Matrix<double, DepthModel::most_drift, 1> drift = Eigen::Vector4d::Zero();  ///< Completed share of each piece.
  double left = 0.0;                                                                 ///< Residual, in σ.
};

/// Rows for a clock that is late by `late_s`.
[[nodiscard]] std::vector<DepthRow> rows_at(const DepthModel& model, double late_s, const SensorPath& path);

struct DepthFit {
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 12, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 12, 12>;
  Vector values;  ///< g, offset, jump, pieces of the drift [m], and the arm, if estimated.
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();
  Matrix cov;          ///< Of `values`, for the given σ.
  double limit = 0.0;  ///< Rejection threshold, in σ.

  [[nodiscard]] Eigen::Vector3d g() const { return values.head<3>(); }
};

/// Fit with rejection of outliers; the inliers remain in `rows`. Empty: too few.
[[nodiscard]] std::optional<DepthFit> fitted_without_far(const DepthModel& model, std::vector<DepthRow>& rows);

/// The model with an unknown arm, initialised by a linear fit that leaves all nine entries of g aᵀ free.
[[nodiscard]] DepthModel with_free_arm(DepthModel model, std::span<const DepthRow> rows);

/// Variance inflation by autocorrelated residuals: first-order autoregression.
[[nodiscard]] double inflation(std::span<const DepthRow> rows);

/// Robust cost over all readings: each residual is capped at the rejection threshold.
struct DepthCost {
  double cost = std::numeric_limits<double>::infinity();  ///< Mean, in σ².
  double unit = 1.0;                                      ///< Change of it that is equivalent to 1 in χ².
  double alike = 1.0, rejected = 0.0;                     ///< Inflation, and share of rejected readings.
  double limit = 0.0;                                     ///< Rejection threshold, in σ.
};
[[nodiscard]] DepthCost cost_of(const DepthModel& model, const std::vector<DepthRow>& rows,
                                std::optional<double> limit = {});

}  // namespace alidade
