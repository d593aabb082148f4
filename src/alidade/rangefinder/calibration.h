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

/// σ of the beam from the first `num` shots of a random order.
struct CountedSigma {
  int num_shots = 0;
  double sigma_origin_m = 0.0, sigma_direction_rad = 0.0;  ///< √trace of the estimate's covariances.
  double bound_origin_m = 0.0, bound_direction_rad = 0.0;  ///< √trace of the Cramér–Rao bound's.
};

/// A shot predicted from all others (leave-one-out); NaN where there is nothing to compare.
struct LeftOutShot {
  std::size_t index = 0;
  double residual_range_m = 0.0;  ///< Predicted from its board − read.
  Eigen::Vector2d residual_px;    ///< Predicted from its reading − seen.
};

/// What was seen in the photo of one shot.
struct ShotPhoto {
  bool has_photo = false;
  std::string fault;    ///< Not readable, or of another size than the camera's; empty otherwise.
  std::string no_spot;  ///< Why there is none; empty where there is one, or where none was looked for.
  std::optional<LaserSpot> spot = {};
  std::string false_spot = {};  ///< What was taken for the spot at first, and why it is none; empty: nothing.
};

/// Everything that a calibration of a rangefinder has to say: what the solve found (beam, camera, shots …), and what it
/// is worth. `by_count`, `left_out` and `gains` are empty where there is no beam.
struct RangefinderCalibration : RangefinderReport {
  std::vector<Shot> measured;     ///< One a placement, with what their photos gave; `shots` says what became of each.
  std::vector<ShotPhoto> photos;  ///< One per shot, where photos were looked at.
  std::vector<Shot> unreadable;   ///< Shots whose photos could not be used; `counts.skipped` says why, in order.
  std::vector<SkippedInput> repeated;  ///< Averaged with the first of their placement; in `counts.skipped`, too.
  RangefinderConfig config;            ///< As used: a scale that nobody gave may be estimated.
  Eigen::MatrixXd covariance;  ///< Of origin, direction (singular along itself) and scale: embedded_covariance().
  std::vector<std::string> parameter_names;  ///< Of `covariance`.
  std::vector<CountedSigma> by_count;        ///< σ against the number of shots.
  std::vector<LeftOutShot> left_out;         ///< Each shot predicted by the others.
  std::vector<ShotGain> gains;               ///< Of the next shot.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Of shots.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
