#include <algorithm>

#include "alidade/estimation/median.h"
#include "alidade/localize/observation_localizer.h"

// Detection of rows of a table that repeat the frame before.

namespace alidade {

/// Whether all points are where they were in the last frame, to all digits: no tracker does that in two images.
bool ObservationLocalizer::shows_last(const ObservationFrame& frame) {
  const std::vector<FeatureObservation>& now = frame.observations;
  const bool is_same =
      now.size() >= min_observations &&
      std::ranges::equal(now, last_seen_, [](const FeatureObservation& a, const FeatureObservation& b) {
        return a.id == b.id && a.px == b.px;
      });
  last_seen_ = now;
  return is_same;
}

/// Whether they are predicted elsewhere now.
bool ObservationLocalizer::should_move(const ObservationFrame& frame) const {
  constexpr double still_px = 0.3;
  std::vector<double> moved_px;
  for (const FeatureObservation& observation : frame.observations)
    if (const auto expected = engine_.best().expected(observation.id))
      moved_px.push_back((expected->px - observation.px).norm());
  return !moved_px.empty() && median_of(std::move(moved_px)) > still_px;
}

/// A repeated frame is not an observation: the pose is predicted from the motion.
PathStep ObservationLocalizer::passed_over(const ObservationFrame& frame) {
  ++num_repeated_;
  PathStep step;
  step.frame = frame.frame;
  step.t_s = frame.t_s;
  step.event = FrameEvent::predicted;
  engine_.fill_pose(step);
  engine_.keep_given();
  return step;
}

}  // namespace alidade
