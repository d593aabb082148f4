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
  double sigma_range_m = std::numeric_limits<double>::quiet_NaN();     ///< Of that residual: the reading, the board.
  Eigen::Vector2d residual_px = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Matrix2d cov_px = Eigen::Matrix2d::Zero();        ///< Of that residual.
  Eigen::Vector3d point_in_cam = Eigen::Vector3d::Zero();  ///< Where the beam says the reading was taken.
  std::optional<Plane> plane = {};                         ///< Of the board, in the camera frame.
  std::optional<BoardPose> pose = {};                      ///< Of the board, as solved; where it has one.
  /// Squared influence of the shot on the estimate over its expectation; 1 in the mean if the noise is as assumed.
  double cluster_z2 = std::numeric_limits<double>::quiet_NaN();
};

/// Something that the solve fixed: the effect of an error of it on the beam, and its score test.
struct FixedQuantity {
  std::string name;  ///< scale, square_m, board.flat_m, camera.f, camera.cx, camera.k1, …, sigma_range_m, sigma_spot_px
  double value = 0.0;
  BeamVector moves = BeamVector::Zero();  ///< ∂ beam / ∂ its value, everything else solved again.
  /// What its error would be, were it free too, and the σ of that: a score (Lagrange multiplier) test. Infinite where
  /// the shots say nothing of it.
  double asked = 0.0, asked_sigma = std::numeric_limits<double>::infinity();
  std::optional<double> sigma = {};  ///< With which it was given; in `beam.cov`.
};

/// An error that the measurements of all shots may share, tested by itself (score test).
struct ShotCause {
  /// drift: of the readings over the rows; bend: over their range; incidence: with the tangent of the angle of
  /// incidence; sheet: the beam meets a surface that lies before or behind the plane of the corners; wander: of the
  /// spots over the rows; bent: of the board out of its plane
  std::string name;
  double size = 0.0;  ///< From the first row to the last; of bend, at the ends of the span; of incidence, at 45°.
  std::string unit;
  double sigmas = 0.0;                    ///< By how many σ the residuals indicate it; 0 with too few shots.
  BeamVector moves = BeamVector::Zero();  ///< Of the beam, were it of that size.
};

/// A sheet before the print, whose surface the beam meets instead: of one that was told, what the shots leave open.
struct CountedSheet {
  double sigma_m = 0.0;                   ///< Of its thickness; 0: none is counted.
  double left_m = 0.0;                    ///< Of the thickness, with what the shots say of it.
  BeamVector moves = BeamVector::Zero();  ///< Of the beam, by left_m.

  [[nodiscard]] BeamMatrix counted() const { return moves * moves.transpose(); }
};

/// Distortion that the camera file gave without σ, and that was estimated from the shots.
struct FreedDistortion {
  std::string name;  ///< k1, k2, p1, p2
  double was = 0.0, value = 0.0, sigma = 0.0;
};

/// A σ that was told, and that is far less than the residuals show: it was estimated from them.
struct OverruledSigma {
  std::string name;  ///< sigma_range_m, sigma_px
  double told = 0.0, found = 0.0;
};

/// How well these shots determine the beam, and their geometry.
struct BeamBound {
  BeamMatrix cov = BeamMatrix::Zero();  ///< Cramér–Rao, lens and poses estimated too; infinite where singular.
  double sigma_origin_m = 0.0;          ///< √trace of the origin's covariance, of the estimate.
  double sigma_direction_rad = 0.0;     ///< √trace of the direction's, of the estimate.
  std::array<double, 4>
      spot_sigma_px{};               ///< Larger axis of the predicted spot at bound_ranges_m, for an exact reading.
  double worst_spot_sigma_px = 0.0;  ///< Of these, at ranges between the nearest shot and the farthest.
  double nearest_m = 0.0, farthest_m = 0.0;  ///< Readings used.
  double condition = 0.0;                    ///< Of the information about the beam, scaled to a unit diagonal.
  double range_ratio = 0.0;                  ///< Longest over shortest reading.
  double normal_spread = 0.0;                ///< Least singular value of the boards' normals over √(their number).
  double offset_m = 0.0;                     ///< Of the beam's line from the camera's centre.
};
inline constexpr std::array<double, 4> bound_ranges_m{0.5, 1.0, 2.0, 4.0};

struct RangefinderReport {
  enum class Status {
    converged,
    too_few,        ///< Shots for the method.
    degenerate,     ///< The information about the beam is singular.
    scale_unknown,  ///< A scale was requested, with spots alone.
    ambiguous,      ///< Two beams explain the shots alike.
    no_convergence
  };
  Status status = Status::too_few;
  Beam beam;                                  ///< Its covariance counts that the measurements of a shot share errors.
  Camera camera;                              ///< As given, or refined with the beam; the beam belongs to it.
  BeamMatrix cov_model = BeamMatrix::Zero();  ///< Of the beam, with independent measurements.
  Eigen::MatrixXd lens_cov_model;             ///< The same of a lens that was refined; 0×0: it was fixed.
  ClusterCovariance clusters;                 ///< What separates the two; shots are its clusters.
  std::vector<FixedQuantity> fixed;
  std::vector<ShotCause> causes;
  CountedSheet sheet;
  std::vector<FreedDistortion> freed_distortion;  ///< Empty: the file's holds.
  std::vector<OverruledSigma> overruled_sigmas;
  bool scale_by_need = false;      ///< The scale was estimated as a nuisance parameter, not as a result.
  std::vector<Beam> alternatives;  ///< Other beams that fit as well.
  std::vector<ShotFit> shots;      ///< One per shot.
  BeamBound bound;
  double sigma_spot_px = 0.0;  ///< Of spots that do not bring their own.
  double sigma_corner_px = 0.0;
  bool spot_sigma_is_estimated = false, range_sigma_is_estimated = false;  ///< From the residuals.
  double cost = 0.0;  ///< Sum of the whitened squared residuals: corners, spots, ranges, prior of the lens.
  int dof = 0;        ///< Of that sum.
  /// What a scale of the readings would be, were it estimated too, less 1, over its σ; 0 where that was not asked.
  double scale_in_sigmas = 0.0;
  double rms_px = 0.0, rms_range_m = 0.0;  ///< Of the spots (per point) and of the ranges used.
  int shots_used = 0, shots_dropped = 0;
  int boards_behind = 0;  ///< Flat boards seen from behind by their corners' order: mirrored images or numbering.
  int iterations = 0;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
