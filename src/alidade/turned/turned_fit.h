#pragma once

#include "alidade/turned/focal_start.h"
#include "alidade/turned/tracks.h"
#include "alidade/turned/turned.h"

namespace alidade {

/// Connected photos after the adjustment, without outliers.
struct TurnedFit {
  TurnedBundle bundle;
  TurnedPrior prior;
  TurnedSolveConfig solve;  ///< With σ estimated from the residuals, or given.
  TurnedSolution solution;
  std::size_t num_kept = 0;  ///< Number of matches used.
};

/// The camera of an initial guess, with its prior. A lens's distortion at the image's corner is 0 ± 8 % (k1), ± 4 %
/// (k2) and ± 2 % (k3), p1 and p2 are 0 ± 0.001; a typical camera's pixels are square within 0.1 %, and its principal
/// point is central within 1.5 % of the width.
[[nodiscard]] TurnedPrior prior_about(double focal, const MatchedPhotos& photos, const TurnedConfig& config);

/// Adjusts the photos of a tree from one initial guess: first with the matches on which a pair agrees, then with all
/// that one camera explains, until the set is stable. `frees_zoom`: each photo may have its own focal length.
[[nodiscard]] TurnedFit fit_turned(const MatchedPhotos& photos, const std::vector<PhotoLink>& links,
                                   const PhotoTree& tree, const FocalStart& start, const TurnedConfig& config,
                                   bool frees_zoom, const Progress& progress);

/// Fits from each initial guess that is not far worse than the first; returns those that succeeded.
[[nodiscard]] std::vector<TurnedFit> fits_from(const std::vector<FocalStart>& starts, const MatchedPhotos& photos,
                                               const std::vector<PhotoLink>& links, const PhotoTree& tree,
                                               const TurnedConfig& config, const Progress& progress);

/// If none of the fits explains the photos well: successful fits from typical focal lengths. With strong distortion the
/// links are most like rotations at no focal length, or at a wrong one.
[[nodiscard]] std::vector<TurnedFit> fits_of_ordinary(const std::vector<TurnedFit>& fits, const MatchedPhotos& photos,
                                                      const std::vector<PhotoLink>& links, const PhotoTree& tree,
                                                      const TurnedConfig& config, const Progress& progress);

/// Sorts the fits by the number of matches used, and returns the best: nearly as many matches, smaller residuals.
[[nodiscard]] std::size_t best_of(std::vector<TurnedFit>& fits);

/// Another focal length that explains nearly as many matches as the best fit, and how much worse it is, √Δχ²; 0: none.
struct OtherMinimum {
  double focal = 0.0, sigmas = 0.0;
};
[[nodiscard]] OtherMinimum other_minimum(const std::vector<TurnedFit>& fits, std::size_t best);

/// Whether a fit is far better than `other`: non-square pixels are too rare to be accepted for less.
[[nodiscard]] bool is_far_better(const TurnedFit& fit, const TurnedFit& other);

/// Fits the same photos again with another config, starting at `fit`.
[[nodiscard]] TurnedFit fit_again(const MatchedPhotos& photos, const PhotoTree& tree, TurnedFit fit,
                                  const TurnedConfig& config, const Progress& progress);

/// The zooms, and σ of each photo's log zoom, if each photo of the fit had its own; by the model.
struct ZoomTest {
  std::vector<double> log_zoom, sigma;
};
[[nodiscard]] ZoomTest free_zooms(TurnedFit fit, const Progress& progress);

/// Degrees of freedom: measurements minus unknowns.
[[nodiscard]] double freedom_of(const TurnedBundle& bundle);

}  // namespace alidade
