#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/beam/shot.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/public.h"
#include "alidade/rangefinder/next_shot.h"
#include "alidade/rangefinder/report.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// σ of the beam estimated from the first `num_shots` shots in random order.
struct CountedSigma {
  int num_shots = 0;
  double sigma_origin_m = 0.0, sigma_direction_rad = 0.0;  ///< √trace of the covariance of the estimate.
  double bound_origin_m = 0.0, bound_direction_rad = 0.0;  ///< √trace of the Cramér–Rao bound.
};

/// A shot predicted from all others (leave-one-out); NaN where there is nothing to compare.
struct LeftOutShot {
  std::size_t index = 0;
  double residual_range_m = 0.0;  ///< Predicted from the board − reading.
  Eigen::Vector2d residual_px;    ///< Predicted from the reading − observed.
};

/// What was seen in the photo of one shot.
struct ShotPhoto {
  bool has_photo = false;
  std::string fault;    ///< Why the photo cannot be used: unreadable, or not of the camera's size; empty otherwise.
  std::string no_spot;  ///< Why there is no spot; empty if there is one, or if none was searched for.
  std::optional<LaserSpot> spot = {};
  std::string false_spot = {};  ///< A light first taken for the spot, and why it is not the spot; empty: none.
};

/// The result of rangefinder(): the estimate (beam, camera, shots …) and the study of its quality. `by_count`,
/// `left_out` and `gains` are empty where no beam could be estimated.
struct RangefinderCalibration : RangefinderReport {
  std::vector<Shot> measured;     ///< One per placement, with detections from its photos; for their use see `shots`.
  std::vector<ShotPhoto> photos;  ///< One per shot; empty if no photos were searched.
  std::vector<Shot> unreadable;   ///< Shots with unusable photos; reasons in `counts.skipped`, in the same order.
  std::vector<SkippedInput> repeated;  ///< Averaged with the first shot of their placement; also in `counts.skipped`.
  RangefinderConfig config;            ///< As used: `estimate_scale` may have been set.
  Eigen::MatrixXd covariance;          ///< Origin, direction (singular along itself), scale: embedded_covariance().
  std::vector<std::string> parameter_names;  ///< Of `covariance`.
  std::vector<CountedSigma> by_count;        ///< σ against the number of shots.
  std::vector<LeftOutShot> left_out;         ///< Each shot predicted from the others.
  std::vector<ShotGain> gains;               ///< Expected σ for candidate next shots.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Number of shots.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
