#include "alidade/localize/checks/summary.h"
#include "alidade/localize/observation_localizer.h"

// What comes of all frames together.

namespace alidade {

Recording ObservationLocalizer::recording() const {
  Recording recording{record_, frames_, {}, episodes_.number_of(), period_s(), {}};
  if (engine_.has_begun()) recording.gone = points_.gone(engine_.best());
  recording.num_used = [this](long id) { return points_.num_used(id); };
  return recording;
}

void ObservationLocalizer::sum_up(Localization& result) const {
  const LocalizeTarget& target = config_.target;
  result.sigma_px = config_.filter.sigma_px;
  result.is_board = target.board.has_value();
  const Recording kept = recording();
  std::optional<WholePath> whole;
  if (config_.smooths) whole = whole_path(kept, engine_, config_, result);
  engine_.sum_up(kept.num_used, result);
  result.num_left = num_left_;
  take_over(whole, kept, engine_, config_, result);
  join_episodes(episodes_, whole ? std::span<const long>(whole->smoothed.ids) : std::span<const long>(), result.map);
  result.known_shift = known_shift(result.map, target.points);
  result.is_behind = is_behind(result.path, target.points, target.seen_from_plus_z);
}

}  // namespace alidade
