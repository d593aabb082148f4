#pragma once

#include "alidade/turned/focal_start.h"
#include "alidade/turned/tracks.h"
#include "alidade/turned/turned.h"

namespace alidade {

/// Connected photos, adjusted, without outliers.
struct TurnedFit {
  TurnedBundle bundle;
  TurnedPrior prior;
  TurnedSolveConfig solve;  ///< With the σ estimated from the residuals, or the given one.
  TurnedSolution solution;
  std::size_t num_kept = 0;  ///< Matches.
};

/// The camera of an initial guess, the prior about it. A lens' distortion at the image's corner is 0 within 8 % (k1),
/// 4 % (k2) and 2 % (k3), its p1 and p2 within 0.001; a typical camera's pixels are square within 0.1 %, its principal
/// point central within 1.5 % of the width.
[[nodiscard]] TurnedPrior prior_about(double focal, const MatchedPhotos& photos, const TurnedConfig& config);

/// Adjusts the photos of a tree from one start: first the matches of which a pair agrees, then all that one camera
/// explains, until none comes or goes. `frees_zoom`: each photo may have its own focal length.
[[nodiscard]] TurnedFit fit_turned(const MatchedPhotos& photos, const std::vector<PhotoLink>& links,
                                   const PhotoTree& tree, const FocalStart& start, const TurnedConfig& config,
                                   bool frees_zoom, const Progress& progress);

/// From each start that is not far worse than the first; those that came to something.
[[nodiscard]] std::vector<TurnedFit> fits_from(const std::vector<FocalStart>& starts, const MatchedPhotos& photos,
                                               const std::vector<PhotoLink>& links, const PhotoTree& tree,
                                               const TurnedConfig& config, const Progress& progress);

/// Where none of the fits explains the photos well: from ordinary focal lengths, those that do. Through a lens that
/// distorts strongly the links are most like rotations at no focal length, or at a wrong one.
[[nodiscard]] std::vector<TurnedFit> fits_of_ordinary(const std::vector<TurnedFit>& fits, const MatchedPhotos& photos,
                                                      const std::vector<PhotoLink>& links, const PhotoTree& tree,
                                                      const TurnedConfig& config, const Progress& progress);

/// Sorts the fits by the matches they keep, and says which explains most: nearly as many, with smaller residuals.
[[nodiscard]] std::size_t best_of(std::vector<TurnedFit>& fits);

/// Another focal length that explains nearly as many matches as the best fit, and how much worse, √Δχ²; 0: none.
struct OtherMinimum {
  double focal = 0.0, sigmas = 0.0;
};
[[nodiscard]] OtherMinimum other_minimum(const std::vector<TurnedFit>& fits, std::size_t best);

/// Far better than `other`: pixels that are not square are too rare to be believed for less.
[[nodiscard]] bool is_far_better(const TurnedFit& fit, const TurnedFit& other);

/// The same photos with another config, from where the fit is.
[[nodiscard]] TurnedFit fit_again(const MatchedPhotos& photos, const PhotoTree& tree, TurnedFit fit,
                                  const TurnedConfig& config, const Progress& progress);

/// σ of each photo's log zoom, and the zooms, if each photo of the fit had its own; by the model.
struct ZoomTest {
  std::vector<double> log_zoom, sigma;
};
[[nodiscard]] ZoomTest free_zooms(TurnedFit fit, const Progress& progress);

/// Measurements minus unknowns.
[[nodiscard]] double freedom_of(const TurnedBundle& bundle);

}  // namespace alidade
