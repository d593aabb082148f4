#include <algorithm>
#include <cmath>

#include "alidade/localize/path/path_system.h"

// How much each point of the map counts. A corner made of two surfaces, one before the other, moves as no point does,
// and so does a track that slides: their residuals are several times those of the others, for as long as they are seen.
// Normal errors whose variance is a point's own, and inverse χ² about the usual one: a multivariate t of each point's
// residuals (K. Lange, R. Little & J. Taylor, "Robust Statistical Modeling Using the t Distribution", JASA 84, 1989).

namespace alidade {
namespace {

struct Squares {
  double sum = 0.0, num = 0.0;  ///< Over σ²; numbers.
  [[nodiscard]] double dof() const { return num - 3.0; }
};

/// The median of the points' mean squares. None of few points.
std::optional<double> usual_of(std::span<const Squares> points) {
  constexpr double enough_numbers = 8.0;
  constexpr std::size_t enough_points = 12;
  std::vector<double> means;
  for (const Squares& each : points)
    if (each.num > enough_numbers) means.push_back(each.sum / each.dof());
  if (means.size() < enough_points) return std::nullopt;
  const auto middle = means.begin() + static_cast<std::ptrdiff_t>(means.size() / 2);
  std::ranges::nth_element(means, middle);
  return *middle;
}

}  // namespace

/// A point whose residuals are larger than the usual ones beyond chance counts by their own σ. Those of given points
/// show an error of what was given, and keep their weight. Whether any has another σ than the stated one.
bool PathSmoother::weigh_points() {
  if (!problem_.weighs_points) return false;
  std::vector<Squares> squares(state_.points.size());
  for (const PlacedResidual& residual : placed_residuals()) {
    const std::size_t point = index_of_.at(residual.id);
    if (problem_.points[point].given_in_world) continue;
    squares[point].sum += residual.residual_px.squaredNorm() / (residual.sigma_px * residual.sigma_px);
    squares[point].num += 2.0;
  }
  const auto usual = usual_of(squares);
  if (!usual || !(*usual > 0.0)) return false;
  usual_variance_ = *usual;
  constexpr double prior_dof = 4.0, chance = 3.5, least_numbers = 6.0, most_lasting = 0.95;
  const double lag = std::clamp(structure_.autocorrelation, 0.0, most_lasting);
  const double lasting = (1.0 + lag * lag) / (1.0 - lag * lag);  // of a mean square's variance
  bool is_any = false;
  for (std::size_t i = 0; i < squares.size(); ++i) {
    error_factors_[i] = 1.0;
    if (squares[i].num < least_numbers) continue;
    const double dof = prior_dof + squares[i].dof();
    const double variance = (prior_dof + squares[i].sum / *usual) / dof;
    if (variance < 1.0 + chance * std::sqrt(2.0 * lasting / dof)) continue;
    error_factors_[i] = std::sqrt(variance);
    is_any = true;
  }
  return is_any;
}

/// Of a squared distance [px²] to where an observation is expected: the gate of the stated σ, or that of twice what the
/// point's errors are found to be, where this is less. A match of another corner half a pixel away fits the stated σ,
/// and counts as much as a hundred of a tenth of it.
double PathSmoother::gate_of(const UsedObservation& observation, std::size_t point) const {
  constexpr double generous = 4.0;
  if (problem_.points[point].given_in_world) return problem_.filter.gate * observation.sigma_px * observation.sigma_px;
  const double found = generous * usual_variance_ * error_factors_[point] * error_factors_[point];
  return problem_.filter.gate * std::min(1.0, found) * observation.sigma_px * observation.sigma_px;
}

}  // namespace alidade
