#pragma once

#include <cstdint>

#include "alidade/rangefinder/solve/beam_solve.h"

namespace alidade {

/// The best beam of the used shots, from every linear start there is, and the others that explain them as well (their
/// cost is within 3σ, 9, of the best, and they are another beam).
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
  bool knows_sigma = true;  ///< Else the scale of the residuals is that of their median.
  double min_scale2 = 0.0;  ///< Of that scale, squared.
};

/// Marks in `used` which shots agree with the beam that most agree with: random samples as small as the method allows,
/// spread in range, each solved, and the best of them refined with those that agree. The beam; none where no sample has
/// one. M. A. Fischler & R. C. Bolles, 1981; P. H. S. Torr & A. Zisserman, 2000 (the truncated cost).
[[nodiscard]] std::optional<Beam> find_outliers(BeamProblem& problem, const Camera& camera,
                                                const OutlierSearch& search);

/// How many shots a sample has, and how many there must be for outliers to be identified.
[[nodiscard]] std::size_t sample_size(const BeamProblem& problem);

/// Has any shot a residual that its σ does not explain?
[[nodiscard]] bool looks_wrong(const BeamProblem& problem, const Camera& camera, const BeamSolution& solution);

/// σ of readings and spots from their own residuals at the beam, a little drawn to the guess where there are few.
/// Returns the largest relative change.
double estimate_noise(BeamProblem& problem, const Camera& camera, const Beam& beam, bool of_spots, bool of_ranges);

/// Do the readings ask for a scale? How far it would be from 1, were it estimated too, lens and poses fixed, over its
/// σ, with the σ of a reading estimated again: where that came of residuals, they contained the missing scale, too.
[[nodiscard]] double scale_in_sigmas(const BeamProblem& problem, const Camera& camera, const Beam& beam,
                                     bool sigma_is_estimated, double min_sigma_m);

}  // namespace alidade
