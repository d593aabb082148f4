#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/board/board.h"
#include "alidade/description/field.h"
#include "alidade/public.h"
#include "alidade/spot/laser_spot.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

enum class RangefinderMethod {
  spot,   ///< Spot and range: no board is needed.
  plane,  ///< Range and board: the spot need not be visible.
  joint,  ///< Whatever each shot provides.
};

enum class Refine {
  beam,  ///< The lens and the board poses are fixed; their uncertainty is propagated to the beam.
  all,   ///< Lens (within its covariance), board poses and beam are estimated together.
};

/// Options of rangefinder(). Plain data with usable defaults.
struct RangefinderConfig {
  RangefinderMethod method = RangefinderMethod::joint;
  Refine refine = Refine::all;
  std::optional<Board> board = {};  ///< The board whose corners are given or shown in the photos. None: no board.
  SpotColour spot = SpotColour::automatic;  ///< Laser colour, for spots that are searched for in photos.
  bool estimate_scale = false;
  bool scale_by_need = false;     ///< `scale` was set because no σ of it was given, not by the user.
  bool refine_distortion = true;  ///< With Refine::all: also the lens parameters other than fx, fy, cx, cy.
  /// σ of measurements without a σ of their own. None: estimated from the residuals.
  std::optional<double> sigma_spot_px = {};
  std::optional<double> sigma_range_m = {};
  std::optional<double> sigma_range_per_m = {}, sigma_incidence_m = {};  ///< Terms that RangeNoise adds to it.
  std::optional<double> sigma_corner_px = {};  ///< Given: replaces the corners' own covariances.
  /// σ of given lengths, propagated to the covariance of the beam. 0: exact. None: unknown.
  std::optional<double> sigma_square_m = {};  ///< σ of the side of the board's squares.
  std::optional<double> sigma_flat_m = {};  ///< σ of the offset of the surface hit by the beam from the corners' plane.
  std::optional<double> sigma_scale = {};   ///< σ of the scale of the readings, where it is not estimated.
  bool reject_outliers = true;
  double outlier_sigmas = 6.0;
  int num_draws = 100;  ///< Of the outlier search; with 3 outliers in 18, a sample of five is clean once in 3 draws.
  std::uint64_t seed = 1;
  int max_iterations = 50;
  bool rates_next_shots = true;  ///< Evaluate candidate shots at other distances and tilts: for the report's map.
  /// Treats the errors of the range residual and of the spot predicted at the range read as independent, although both
  /// contain the reading's error. For comparison with published weights; by default the reading is counted once.
  bool reading_counts_twice = false;

  /// Noise of a reading, where it is given.
  [[nodiscard]] std::optional<RangeNoise> range_noise() const;
  void set_range_noise(const RangeNoise& noise);
};

/// The words of the methods: spot, plane, joint.
[[nodiscard]] const WordList<RangefinderMethod>& rangefinder_method_words();

/// The fields of `config` that a user sets: method, refine, spot, scale, sigma_px, sigma_range_m, sigma_square_m,
/// sigma_scale, sigma_range_per_m, sigma_incidence_m, outliers. The board has its own fields.
[[nodiscard]] FieldList fields_of(RangefinderConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(RangefinderConfig config);

ALIDADE_PUBLIC_END
}  // namespace alidade
