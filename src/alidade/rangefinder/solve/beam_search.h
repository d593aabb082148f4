#pragma once

#include <cstdint>

#include "alidade/rangefinder/solve/beam_solve.h"

namespace alidade {

/// The best beam for the used shots, from all linear initial guesses, and other beams that explain them as well (cost
/// within 9, that is 3σ, of the best, and distinctly different).
struct BeamFit {
  BeamSolution best;
  std::vector<Beam> alternatives;
};
[[nodiscard]] std::optional<BeamFit> best_beam(const BeamProblem& problem, const Camera& camera,
                                               const std::optional<Beam>& also_from = {});

struct OutlierSearch {
  double sigmas = 6.0;
  int num_draws = 100;
  std::uint64_t seed = 1;
  bool knows_sigma = true;  ///< False: the scale of the residuals is estimated from their median.
  double min_scale2 = 0.0;  ///< Lower bound of that scale, squared.
};

/// Marks in `used` the shots that agree with the beam of the largest consensus: minimal random samples for the method,
/// spread in range, each solved, and the best ones refined with their inliers. Returns the beam; none if no sample
/// gives one. M. A. Fischler & R. C. Bolles, 1981; P. H. S. Torr & A. Zisserman, 2000 (the truncated cost).
[[nodiscard]] std::optional<Beam> find_outliers(BeamProblem& problem, const Camera& camera,
                                                const OutlierSearch& search);

/// Size of a sample, and the number of shots needed to identify outliers.
[[nodiscard]] std::size_t sample_size(const BeamProblem& problem);

/// Whether any shot has a residual that its σ does not explain.
[[nodiscard]] bool looks_wrong(const BeamProblem& problem, const Camera& camera, const BeamSolution& solution);

/// σ of readings and spots from their residuals for the beam, regularised towards the initial value if there are few.
/// Returns the largest relative change.
double estimate_noise(BeamProblem& problem, const Camera& camera, const Beam& beam, bool of_spots, bool of_ranges);

/// Whether the readings indicate a scale: (scale − 1) / σ if it were estimated too, lens and poses fixed, with the σ of
/// a reading estimated again: if it came from residuals, these contained the effect of the missing scale.
[[nodiscard]] double scale_in_sigmas(const BeamProblem& problem, const Camera& camera, const Beam& beam,
                                     bool sigma_is_estimated, double min_sigma_m);

}  // namespace alidade
