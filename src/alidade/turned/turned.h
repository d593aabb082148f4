#pragma once

#include <optional>

#include "alidade/estimation/verdict.h"
#include "alidade/matching/matched_photos.h"
#include "alidade/observe/report.h"
#include "alidade/turned/turned_bundle.h"

namespace alidade {

struct ObserveConfig;  // observe.h

struct TurnedConfig {
  bool square_pixels = false;  ///< fx = fy.
  bool fixed_centre = false;   ///< Fix cx, cy at the initial guess, else at the image's centre.
  /// fx / fy and the centre are typical, within a σ that is included; false: nothing is known of them.
  bool ordinary_aspect = true, ordinary_centre = true;
  double aspect = 1.0;                   ///< fy / fx of a typical camera; the initial guess if it is estimated.
  int lens_terms = 2;                    ///< Radial terms fitted first: none, k1, k1 and k2, or k3 as well.
  bool decentred = false;                ///< Estimate p1 and p2 as well.
  bool keeps_terms = false;              ///< Just these terms; false: all that differ significantly from zero.
  std::optional<Eigen::Vector4d> start;  ///< fx, fy, cx, cy [px].
  double sigma_px = 0.0;                 ///< σ of a coordinate; 0: estimated from the residuals.
  /// σ of the translation of the projection centre, over the points' distance, per radian of rotation; none: typical.
  std::optional<double> sigma_parallax;
};

struct TurnedReport {
  enum class Status {
    ok,
    too_few_photos,  ///< Fewer than three photos are connected.
    no_turn,
    zoomed,
    moved,  ///< Each pair agrees with a plane, but all together not with one rotating camera.
    weak,
    no_convergence
  };
  Status status = Status::too_few_photos;
  std::vector<RotatedPhoto> photos;
  TurnedBundle bundle;  ///< Normalised; its photos are listed in `bundle_photo`.
  std::vector<int> bundle_photo;
  std::vector<Eigen::Vector2d> residuals;  ///< Normalised, one per observation.
  TurnedCamera camera;                     ///< fx, fy, cx, cy in px.
  TurnedInformation cov, cov_model;
  /// Lens terms that are estimated; the uncertainty of the others is included in `cov`.
  int lens_terms = 0;
  bool decentred = false;
  double lens_departs = 0.0;  ///< Relative change of fx with k4, which the model lacks; 0: not significant.
  double sigma_px = 0.0;
  MatchCounts matches;
  double design_effect = 1.0;  ///< Variance of the estimate between photos, over the model's.
  double degrees_of_freedom = 0.0;
  double largest_turn_rad = 0.0;
  ParallaxTest parallax;
  Eigen::Vector2d free_centre_px = Eigen::Vector2d::Zero();  ///< Estimated centre if it is not fixed; next, its σ.
  Eigen::Vector2d sigma_free_centre_px = Eigen::Vector2d::Zero();
  double free_aspect = 1.0, sigma_free_aspect = 0.0;  ///< fy / fx if pixels are not square, and its σ.
  double other_focal_px = 0.0, other_sigmas = 0.0;  ///< A second minimum, and how much worse it is (√Δχ²); 0: none.
  std::vector<Assumption> assumed;
};

/// Intrinsics of a camera from photos taken while it rotated at one position, by hand for example: f, centre and radial
/// distortion, from matches of which many may be wrong. Throws Interrupted. docs/maths/turned-photos.md.
[[nodiscard]] TurnedReport observe_turned(const MatchedPhotos& photos, const TurnedConfig& config,
                                          const Progress& progress = {});

/// observe() of photos with known matches: with the typical priors of photos, which observe() of matches does not
/// assume.
[[nodiscard]] ObserveReport observe_matched(MatchedPhotos photos, const ObserveConfig& config,
                                            const Progress& progress = {});

/// Assessment of the result, or why there is none and what to add.
[[nodiscard]] Verdict turned_verdict(const TurnedReport& report, const MatchedPhotos& photos,
                                     const TurnedConfig& config);

}  // namespace alidade
