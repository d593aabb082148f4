#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "alidade/beam/shot.h"
#include "alidade/estimation/cluster_covariance.h"
#include "alidade/public.h"
#include "alidade/rangefinder/config.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// One shot after the solve. NaN where there is nothing to compare.
struct ShotFit {
  bool used = false;
  std::string reason;                                                  ///< Why it was not used; empty otherwise.
  double residual_range_m = std::numeric_limits<double>::quiet_NaN();  ///< Predicted from the board − read.
  double sigma_range_m = std::numeric_limits<double>::quiet_NaN();     ///< σ of that residual, from reading and board.
  Eigen::Vector2d residual_px = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Matrix2d cov_px = Eigen::Matrix2d::Zero();        ///< Covariance of residual_px.
  Eigen::Vector3d point_in_cam = Eigen::Vector3d::Zero();  ///< Point that the beam predicts for the reading.
  std::optional<Plane> plane = {};                         ///< The board's plane, in the camera frame.
  std::optional<BoardPose> pose = {};  ///< The board's pose after the solve, where the shot has one.
  /// Squared influence of the shot on the estimate over its expectation; 1 on average if the noise is as assumed.
  double cluster_z2 = std::numeric_limits<double>::quiet_NaN();
};

/// A quantity that the solve kept fixed: how an error of it changes the beam, and its score test.
struct FixedQuantity {
  std::string name;  ///< scale, square_m, board.flat_m, camera.f, camera.cx, camera.k1, …, sigma_range_m, sigma_spot_px
  double value = 0.0;
  BeamVector moves = BeamVector::Zero();  ///< ∂ beam / ∂ value, everything else re-estimated.
  /// Score (Lagrange multiplier) test: change of `value` if it were estimated too, and the σ of that change.
  /// Infinite σ where the shots contain no information about it.
  double asked = 0.0, asked_sigma = std::numeric_limits<double>::infinity();
  std::optional<double> sigma = {};  ///< σ with which it was given; included in `beam.cov`.
};

/// An error that the measurements of all shots may have in common, tested on its own (score test).
struct ShotCause {
  /// drift: of the readings, linear over the rows; bend: of the readings, quadratic in the range; incidence: of the
  /// readings, with the tangent of the incidence angle; sheet: the beam hits a surface in front of or behind the plane
  /// of the corners; wander: of the spots, linear over the rows; bent: the board is bent out of its plane
  std::string name;
  double size = 0.0;  ///< drift, wander: first to last row; bend: at the ends of the range span; incidence: 45°.
  std::string unit;
  double sigmas = 0.0;                    ///< Significance in the residuals [σ]; 0 with too few shots.
  BeamVector moves = BeamVector::Zero();  ///< Change of the beam if the error has this size.
};

/// A sheet of uncertain thickness in front of the print, which the beam hits instead: its uncertainty after the shots.
struct CountedSheet {
  double sigma_m = 0.0;                   ///< σ of its thickness as given; 0: not considered.
  double left_m = 0.0;                    ///< σ of its thickness after the shots.
  BeamVector moves = BeamVector::Zero();  ///< Change of the beam for a thickness of left_m.

  [[nodiscard]] BeamMatrix counted() const { return moves * moves.transpose(); }
};

/// A distortion coefficient that the camera file gave without σ, and that was estimated from the shots.
struct FreedDistortion {
  std::string name;  ///< k1, k2, p1, p2
  double was = 0.0, value = 0.0, sigma = 0.0;
};

/// A given σ that is far smaller than the residuals show: it was estimated from them instead.
struct OverruledSigma {
  std::string name;  ///< sigma_range_m, sigma_px
  double told = 0.0, found = 0.0;
};

/// How well these shots determine the beam, and their geometry.
struct BeamBound {
  BeamMatrix cov = BeamMatrix::Zero();  ///< Cramér–Rao; lens and poses are estimated too. Infinite where singular.
  double sigma_origin_m = 0.0;          ///< √trace of the covariance of the estimated origin.
  double sigma_direction_rad = 0.0;     ///< √trace of the covariance of the estimated direction.
  std::array<double, 4>
      spot_sigma_px{};  ///< σ along the larger axis of the predicted spot at bound_ranges_m, for an exact reading.
  double worst_spot_sigma_px = 0.0;          ///< Largest of these, the ranges clamped to [nearest_m, farthest_m].
  double nearest_m = 0.0, farthest_m = 0.0;  ///< Shortest and longest reading used.
  double condition = 0.0;                    ///< Condition number of the beam's information matrix, unit diagonal.
  double range_ratio = 0.0;                  ///< Longest reading over shortest.
  double normal_spread = 0.0;                ///< Smallest singular value of the boards' normals over √(their number).
  double offset_m = 0.0;                     ///< Distance of the beam's line from the camera's centre.
};
inline constexpr std::array<double, 4> bound_ranges_m{0.5, 1.0, 2.0, 4.0};

struct RangefinderReport {
  enum class Status {
    converged,
    too_few,        ///< Too few shots for the method.
    degenerate,     ///< The information about the beam is singular.
    scale_unknown,  ///< The scale was to be estimated from spots alone.
    ambiguous,      ///< Two beams explain the shots equally well.
    no_convergence
  };
  Status status = Status::too_few;
  Beam beam;                                  ///< Its covariance accounts for errors shared within a shot.
  Camera camera;                              ///< As given, or refined with the beam; the beam belongs to it.
  BeamMatrix cov_model = BeamMatrix::Zero();  ///< Covariance of the beam for independent measurements.
  Eigen::MatrixXd lens_cov_model;             ///< The same for a refined lens; 0×0: the lens was fixed.
  ClusterCovariance clusters;                 ///< Explains the difference between the two; one cluster per shot.
  std::vector<FixedQuantity> fixed;
  std::vector<ShotCause> causes;
  CountedSheet sheet;
  std::vector<FreedDistortion> freed_distortion;  ///< Empty: the distortion of the file was kept.
  std::vector<OverruledSigma> overruled_sigmas;
  bool scale_by_need = false;      ///< The scale was estimated as a nuisance parameter, not as a result.
  std::vector<Beam> alternatives;  ///< Other beams that fit as well.
  std::vector<ShotFit> shots;      ///< One per shot.
  BeamBound bound;
  double sigma_spot_px = 0.0;  ///< For spots without a σ of their own.
  double sigma_corner_px = 0.0;
  bool spot_sigma_is_estimated = false, range_sigma_is_estimated = false;  ///< From the residuals.
  double cost = 0.0;  ///< Sum of squared whitened residuals: corners, spots, ranges, prior of the lens.
  int dof = 0;        ///< Degrees of freedom of `cost`.
  /// (scale − 1) / σ, where the scale of the readings was estimated or tested; 0 otherwise.
  double scale_in_sigmas = 0.0;
  double rms_px = 0.0, rms_range_m = 0.0;  ///< RMS of the used spots (per point) and ranges.
  int shots_used = 0, shots_dropped = 0;
  int boards_behind = 0;  ///< Flat boards whose corners run as if seen from behind: mirrored image or numbering.
  int iterations = 0;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
