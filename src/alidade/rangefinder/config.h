#pragma once

#include <cstdint>
#include <optional>

#include "alidade/beam/beam.h"

namespace alidade {

enum class RangefinderMethod {
  spot,   ///< Spot and range: no board is needed.
  plane,  ///< Range and board: the spot need not be seen.
  joint,  ///< Whatever each shot has.
};

enum class Refine {
  beam,  ///< The lens and the boards' poses are held, their uncertainty is carried into the beam's.
  all,   ///< Lens (as its covariance allows), poses and beam together.
};

/// Options of calibrate_rangefinder(). Plain data with usable defaults.
struct RangefinderConfig {
  RangefinderMethod method = RangefinderMethod::joint;
  Refine refine = Refine::all;
  bool estimate_scale = false;
  bool scale_by_need = false;     ///< It is estimated as nobody told it, not because a person knows that it is off.
  bool refine_distortion = true;  ///< With Refine::all: also what of the lens is not fx, fy, cx, cy.
  /// σ of the measurements that do not bring their own. None: told by the residuals.
  std::optional<double> sigma_spot_px = {};
  std::optional<RangeNoise> range_noise = {};
  std::optional<double> sigma_corner_px = {};  ///< Given: takes the place of the corners' own covariances.
  /// σ of what is told of lengths: carried into the beam's covariance. 0: exact. None: nothing is known.
  std::optional<double> sigma_square_m = {};  ///< Of the length of the board's squares.
  std::optional<double> sigma_scale = {};     ///< Of the scale of the readings, where that is not estimated.
  bool reject_outliers = true;
  double outlier_sigmas = 6.0;
  int num_draws = 100;  ///< Of the search for outliers; a sample of five without any of 3 wrong in 18 comes once in 3.
  std::uint64_t seed = 1;
  int max_iterations = 50;
  /// Takes the spot at the range as read and the range residual as if their errors were independent, although both hold
  /// the reading's. For comparison with published weights; the default counts the reading once.
  bool reading_counts_twice = false;
};

}  // namespace alidade
