#include <algorithm>
#include <cmath>

#include "alidade/localize/path/path_system.h"

// Weight of each point of the map. A corner formed by two surfaces at different depths moves like no point, and so does
// a track that slides: their residuals are several times those of others, as long as they are seen. Model: normal
// errors with a variance per point, with an inverse χ² prior about the typical one: multivariate t residuals of each
// point (K. Lange, R. Little & J. Taylor, "Robust Statistical Modeling Using the t Distribution", JASA 84, 1989).

namespace alidade {
namespace {

struct Squares {
  double sum = 0.0, num = 0.0;  ///< Σ of squares over σ²; their number.
  [[nodiscard]] double dof() const { return num - 3.0; }
};

/// Median of the points' mean squares. Empty for few points.
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

/// Points whose residuals are significantly larger than typical get their own σ. Residuals of given points show an
/// error of the given position, so these keep their weight. Returns whether any σ differs from the stated one.
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
  const double lasting = (1.0 + lag * lag) / (1.0 - lag * lag);  // of a mean square's variance, by autocorrelation
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

/// Gate for the squared distance [px²] to the prediction: that of the stated σ, or of twice the σ estimated for the
/// point, whichever is smaller. A match of another corner half a pixel away fits the stated σ, and counts as much as a
/// hundred matches with errors of a tenth of that.
double PathSmoother::gate_of(const UsedObservation& observation, std::size_t point) const {
  constexpr double generous = 4.0;
  if (problem_.points[point].given_in_world) return problem_.filter.gate * observation.sigma_px * observation.sigma_px;
  const double found = generous * usual_variance_ * error_factors_[point] * error_factors_[point];
  return problem_.filter.gate * std::min(1.0, found) * observation.sigma_px * observation.sigma_px;
}

}  // namespace alidade
