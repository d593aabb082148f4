#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

// depth = offset + g·r + down·R a: of a depth sensor at a in the frame of a camera at r with rotation R, with
// down = g/|g| and |g| metres per unit of the path; and what else may be in its readings.

namespace alidade {

/// What is supposed of a depth sensor beside its scale, its direction and its offset.
struct DepthModel {
  std::span<const DepthReading> readings;
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();  ///< a as given,
  std::optional<double> sigma_arm_m;                ///< and σ of each coordinate: then it is estimated. None: exact.
  double jump_s = std::numeric_limits<double>::infinity();  ///< From when on the offset is another one.
  int num_drift = 0;         ///< The offset drifts: so many straight pieces of equal length; at most `most_drift`.
  bool is_arm_free = false;  ///< It is estimated as if nothing were known of it.
  std::optional<Eigen::Vector3d> g, arm_at;  ///< To begin at, where an arm makes it nonlinear.

  static constexpr int most_drift = 4;
  [[nodiscard]] bool has_arm() const { return sigma_arm_m || !arm_m.isZero(0.0); }
  [[nodiscard]] int dim() const { return 5 + num_drift + (sigma_arm_m ? 3 : 0); }
};

/// A reading, and where the camera was.
struct DepthRow {
  double depth_m = 0.0, weight = 1.0;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  double after_jump = 0.0;
  Eigen::Matrix<double, DepthModel::most_drift, 1> drift = Eigen::Vector4d::Zero();  ///< Share of each piece so far.
  double left = 0.0;                                                                 ///< Of the depth, in σ.
};

/// By a clock that is late by so much.
[[nodiscard]] std::vector<DepthRow> rows_at(const DepthModel& model, double late_s, const SensorPath& path);

struct DepthFit {
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 12, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 12, 12>;
  Vector values;  ///< g, offset, jump, pieces of the drift [m], and where it is estimated the arm.
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();
  Matrix cov;          ///< Of `values`, by the given σ.
  double limit = 0.0;  ///< Beyond which a reading is rejected, in σ.

  [[nodiscard]] Eigen::Vector3d g() const { return values.head<3>(); }
};

/// By the readings that are near the others; these are left in `rows`. None: too few.
[[nodiscard]] std::optional<DepthFit> fitted_without_far(const DepthModel& model, std::vector<DepthRow>& rows);

/// The model with an arm of which nothing is known, begun where a linear fit that leaves all of g aᵀ free has it.
[[nodiscard]] DepthModel with_free_arm(DepthModel model, std::span<const DepthRow> rows);

/// How much less than their number they determine whose neighbours are alike: an autoregression of first order.
[[nodiscard]] double inflation(std::span<const DepthRow> rows);

/// How all readings fit: where one is far off, as far as it would just not be rejected.
struct DepthCost {
  double cost = std::numeric_limits<double>::infinity();  ///< Mean, in σ².
  double unit = 1.0;                                      ///< Of it, what one of them all is by chance.
  double alike = 1.0, rejected = 0.0;                     ///< Inflation, and share.
  double limit = 0.0;                                     ///< Beyond which they are, in σ.
};
[[nodiscard]] DepthCost cost_of(const DepthModel& model, const std::vector<DepthRow>& rows,
                                std::optional<double> limit = {});

}  // namespace alidade
