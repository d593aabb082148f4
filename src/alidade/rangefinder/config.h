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
  plane,  ///< Range and board: the spot need not be seen.
  joint,  ///< Whatever each shot has.
};

enum class Refine {
  beam,  ///< The lens and the boards' poses are fixed, their uncertainty is carried into the beam's.
  all,   ///< Lens (as its covariance allows), poses and beam together.
};

/// Options of rangefinder(). Plain data with usable defaults.
struct RangefinderConfig {
  RangefinderMethod method = RangefinderMethod::joint;
  Refine refine = Refine::all;
  std::optional<Board> board = {};  ///< Whose corners the shots have, or that their photos show. None: no board.
  SpotColour spot = SpotColour::automatic;  ///< Of the laser, where spots are looked for in photos.
  bool estimate_scale = false;
  bool scale_by_need = false;     ///< `scale` was set because no σ of it was given, not by the user.
  bool refine_distortion = true;  ///< With Refine::all: also what of the lens is not fx, fy, cx, cy.
  /// σ of the measurements that do not bring their own. None: estimated from the residuals.
  std::optional<double> sigma_spot_px = {};
  std::optional<double> sigma_range_m = {};
  std::optional<double> sigma_range_per_m = {}, sigma_incidence_m = {};  ///< Of sigma_range_m: RangeNoise.
  std::optional<double> sigma_corner_px = {};  ///< Given: replaces the corners' own covariances.
  /// σ of what is given of lengths: carried into the beam's covariance. 0: exact. None: nothing is known.
  std::optional<double> sigma_square_m = {};  ///< Of the length of the board's squares.
  std::optional<double> sigma_flat_m = {};    ///< Of the surface that the beam meets, off the plane of the corners.
  std::optional<double> sigma_scale = {};     ///< Of the scale of the readings, where that is not estimated.
  bool reject_outliers = true;
  double outlier_sigmas = 6.0;
  int num_draws = 100;  ///< Of the search for outliers; a sample of five without any of 3 wrong in 18 comes once in 3.
  std::uint64_t seed = 1;
  int max_iterations = 50;
  bool rates_next_shots = true;  ///< What shots at other distances and tilts would bring: for the report's map.
  /// Takes the spot at the range as read and the range residual as if their errors were independent, although both hold
  /// the reading's. For comparison with published weights; the default counts the reading once.
  bool reading_counts_twice = false;

  /// Of a reading, where it is given.
  [[nodiscard]] std::optional<RangeNoise> range_noise() const;
  void set_range_noise(const RangeNoise& noise);
};

/// The words of the methods: spot, plane, joint.
[[nodiscard]] const WordList<RangefinderMethod>& rangefinder_method_words();

/// The fields of `config` that a person sets: method, refine, spot, scale, sigma_px, sigma_range_m, sigma_square_m,
/// sigma_scale, sigma_range_per_m, sigma_incidence_m, outliers. The board has fields of its own.
[[nodiscard]] FieldList fields_of(RangefinderConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(RangefinderConfig config);

ALIDADE_PUBLIC_END
}  // namespace alidade
