#include "alidade/localize/checks/summary.h"
#include "alidade/localize/frames/still_frames.h"
#include "alidade/localize/map/moved_part.h"
#include "alidade/localize/observation_localizer.h"

// Results from all frames together.

namespace alidade {
namespace {

bool each_states_sigma(std::span<const ObservationFrame> frames) {
  std::size_t num = 0;
  for (const ObservationFrame& frame : frames) {
    num += frame.observations.size();
    for (const FeatureObservation& each : frame.observations)
      if (!(each.sigma_px > 0.0)) return false;
  }
  return num > 0;
}

}  // namespace

Recording ObservationLocalizer::recording(const KeptFrames& frames) const {
  Recording recording{record_, frames, {}, episodes_.number_of(), period_s(), {}};
  if (engine_.has_begun()) recording.gone = points_.gone(engine_.best());
  recording.num_used = [this](long id) { return points_.num_used(id); };
  return recording;
}

std::vector<ObservationFrame> ObservationLocalizer::numbered_frames() const {
  std::vector<ObservationFrame> frames = frames_.frames();
  for (ObservationFrame& frame : frames)
    for (FeatureObservation& each : frame.observations) each.id = episodes_.number(each.id);
  return frames;
}

/// From one place the apparent parallax grows with the number of poses (frames/still_frames.h): if the camera hardly
/// translates, only some fifty frames are used, if necessary with known points only. IMU readings need all frames.
std::optional<ObservationLocalizer::Solution> ObservationLocalizer::solved(Localization& result) const {
  constexpr std::size_t enough = 50;
  const std::span<const KnownPoint> known = config_.target.points;
  const auto of_few = [&](std::optional<KeptFrames> few, bool is_of_known) -> std::optional<Solution> {
    auto whole = few ? whole_path(recording(*few), engine_, config_, result) : std::nullopt;
    if (!whole) return std::nullopt;
    return Solution{std::move(*whole), std::move(few), is_of_known};
  };
  const bool may_be_few = !known.empty() && !config_.imu;
  if (may_be_few)
    if (auto still = of_few(averaged_still(frames_, known, result.sigma_px), true)) return still;
  const Localization before = result;
  auto all = whole_path(recording(frames_), engine_, config_, result);
  const std::size_t num_each = frames_.frames().size() / enough;
  if (may_be_few && num_each > 1 && (!all || all->smoothed.is_from_one_place)) {
    const Localization of_all = result;
    for (const bool is_of_known : {false, true}) {
      result = before;
      auto few = of_few(frames_.every(num_each, is_of_known ? known : std::span<const KnownPoint>()), is_of_known);
      if (few && few->whole.smoothed.is_from_one_place) return few;
    }
    result = of_all;
  }
  if (!all) return std::nullopt;
  return Solution{std::move(*all), {}, false};
}

void ObservationLocalizer::sum_up(Localization& result) const {
  const LocalizeTarget& target = config_.target;
  result.sigma_px = config_.filter.sigma_px;
  if (each_states_sigma(frames_.frames())) result.sigma_px_from = SigmaPxFrom::rows;
  result.num_repeated = num_repeated_;
  result.is_board = target.board.has_value();
  std::optional<Solution> solution;
  if (config_.smooths) solution = solved(result);
  const Recording kept = recording(solution && solution->few ? *solution->few : frames_);
  const std::optional<WholePath> whole = solution ? std::optional(std::move(solution->whole)) : std::nullopt;
  engine_.sum_up(kept.num_used, result);
  result.num_left = num_left_;
  take_over(whole, kept, engine_, config_, result);
  if (solution && solution->is_of_known)  // from one place, a filter's depths of other points are noise
    std::erase_if(result.map, [](const MapPoint& point) { return !point.is_known; });
  join_episodes(episodes_, whole ? std::span<const long>(whole->smoothed.ids) : std::span<const long>(), result.map);
  result.known_shift = known_shift(result.map, target.points);
  if (whole && !config_.map && !target.board) result.moved_part = moved_part(result.map, target.points);
  result.is_behind = is_behind(result.path, target.points, target.seen_from_plus_z);
}

void ObservationLocalizer::sum_up_recent(Localization& recent) {
  engine_.sum_up_recent([this](long id) { return points_.num_used(id); }, recent);
  recent.is_behind = is_behind(recent.path, config_.target.points, config_.target.seen_from_plus_z);
}

}  // namespace alidade
