#include "alidade/localize/checks/radial_residuals.h"

#include <algorithm>
#include <cmath>

namespace alidade {

void RadialResiduals::add(const LocalizationFilter& filter, std::span<const FeatureObservation> observations,
                          std::span<const ObservationOutcome> outcomes) {
  const Camera& camera = filter.camera();
  const Eigen::Vector2d size(camera.width_px, camera.height_px), centre = 0.5 * size;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const FeatureObservation& observation = observations[i];
    if (outcomes[i] != ObservationOutcome::used) continue;
    const auto feature = std::ranges::find(filter.features(), observation.id, &Feature::id);
    if (feature == filter.features().end()) continue;
    const auto view = expected_view(camera, filter.motion().world_from_cam, *feature);
    const Eigen::Vector2d out = observation.px - centre;
    if (!view || !(out.norm() > 1.0)) continue;
    const double residual_px = out.normalized().dot(observation.px - view->px);
    const double share = std::min(out.norm() / (0.5 * size.norm()), 0.999);
    Ring& ring = rings_[static_cast<std::size_t>(share * num_rings)];
    ring.num += 1.0;
    ring.sum_px += residual_px;
    ring.sum += residual_px / (observation.sigma_px > 0.0 ? observation.sigma_px : filter.config().sigma_px);
  }
}

RadialStructure RadialResiduals::structure() const {
  constexpr double min_in_ring = 10.0;
  RadialStructure structure;
  double num = 0.0;
  for (const Ring& ring : rings_) {
    if (ring.num < min_in_ring) continue;
    num += 1.0;
    structure.share += std::pow(ring.sum / ring.num, 2);
    structure.chi2_per_ring += ring.sum * ring.sum / ring.num;
    structure.worst_px = std::max(structure.worst_px, std::abs(ring.sum_px / ring.num));
  }
  if (num > 0.0) {
    structure.share = std::sqrt(structure.share / num);
    structure.chi2_per_ring /= num;
  }
  return structure;
}

}  // namespace alidade
