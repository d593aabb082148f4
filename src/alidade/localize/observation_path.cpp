#include "alidade/localize/checks/summary.h"
#include "alidade/localize/frames/still_frames.h"
#include "alidade/localize/observation_localizer.h"

// What comes of all frames together.

namespace alidade {

Recording ObservationLocalizer::recording(const KeptFrames& frames) const {
  Recording recording{record_, frames, {}, episodes_.number_of(), period_s(), {}};
  if (engine_.has_begun()) recording.gone = points_.gone(engine_.best());
  recording.num_used = [this](long id) { return points_.num_used(id); };
  return recording;
}

void ObservationLocalizer::sum_up(Localization& result) const {
  const LocalizeTarget& target = config_.target;
  result.sigma_px = config_.filter.sigma_px;
  result.is_board = target.board.has_value();
  // An IMU's readings are of all frames; without a target nothing is seen of a still camera's depths.
  std::optional<KeptFrames> still;
  if (config_.smooths && !config_.imu && !target.points.empty())
    still = averaged_still(frames_, target.points, result.sigma_px);
  std::optional<WholePath> whole;
  if (still) whole = whole_path(recording(*still), engine_, config_, result);
  const Recording kept = recording(whole ? *still : frames_);
  if (config_.smooths && !whole) whole = whole_path(kept, engine_, config_, result);
  engine_.sum_up(kept.num_used, result);
  result.num_left = num_left_;
  take_over(whole, kept, engine_, config_, result);
  if (whole && still)  // what a filter says of other points' depths from one place is what noise seems to move it by
    std::erase_if(result.map, [](const MapPoint& point) { return !point.is_known; });
  join_episodes(episodes_, whole ? std::span<const long>(whole->smoothed.ids) : std::span<const long>(), result.map);
  result.known_shift = known_shift(result.map, target.points);
  result.is_behind = is_behind(result.path, target.points, target.seen_from_plus_z);
}

}  // namespace alidade
