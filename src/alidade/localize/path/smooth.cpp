#include "alidade/localize/path/smooth.h"

#include <algorithm>
#include <cmath>

#include "alidade/localize/checks/residual_structure.h"
#include "alidade/localize/engine.h"

namespace alidade {
namespace {

/// Errors that last from frame to frame by an autoregression of first order: so many fewer are independent.
void enlarge(SmoothedPath& smoothed, const ResidualStructure& residuals) {
  if (!residuals.has_colour()) return;
  const double correlation = std::min(residuals.colour, 0.95), factor = (1.0 + correlation) / (1.0 - correlation);
  for (auto& cov : smoothed.cov) cov *= factor;
  for (auto& cov : smoothed.point_covs) cov *= factor;
  smoothed.sigma_lens *= std::sqrt(factor);
}

/// What of each frame fits the smoothed path: frames that the filter had lost may be held by their observations there.
void judge_frames(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                  Localization& result) {
  std::vector<std::size_t> num_fit(result.path.size(), 0);
  for (const PlacedResidual& residual : smoothed.residuals) ++num_fit[first_frame + residual.frame];
  for (std::size_t k = first_frame; k < result.path.size(); ++k) {
    PathStep& step = result.path[k];
    const bool was_lost = step.event == FrameEvent::predicted || step.event == FrameEvent::waiting;
    if (was_lost && num_fit[k] >= min_observations) step.event = FrameEvent::tracked;
    std::size_t num_of_map = 0;
    for (const FeatureObservation& observation : frames[k].observations)
      num_of_map += std::ranges::binary_search(smoothed.ids, observation.id) ? 1 : 0;
    result.num_unexplained += 2 * num_fit[k] < num_of_map ? 1 : 0;
  }
}

}  // namespace

std::optional<SmoothedPath> smooth(const SmootherProblem& problem, std::span<const ObservationFrame> frames,
                                   Localization& result) {
  auto smoothed = smoothed_path(problem);
  if (!smoothed) return std::nullopt;
  result.residuals = residual_structure(smoothed->residuals, problem.camera.width_px, problem.camera.height_px);
  enlarge(*smoothed, result.residuals);
  for (std::size_t k = 0; k < smoothed->cov.size(); ++k) {
    PathStep& step = result.path[problem.first_frame + k];
    step.world_from_cam = smoothed->world_from_cam[k];
    step.cov = smoothed->cov[k];
  }
  judge_frames(*smoothed, problem.first_frame, frames, result);
  return smoothed;
}

}  // namespace alidade
