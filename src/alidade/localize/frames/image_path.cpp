#include <algorithm>
#include <cmath>

#include "alidade/localize/checks/summary.h"
#include "alidade/localize/frames/image_localizer.h"

// Results from all images together.

namespace alidade {

/// Removes a landmark from a full map, but keeps its contribution to the path.
void ImageLocalizer::let_go(long id) {
  const LocalizationFilter& filter = engine_.best();
  const auto place = filter.place(id);
  const auto feature = std::ranges::find(filter.features(), id, &Feature::id);
  const auto num_found = static_cast<std::size_t>(landmarks_.at(id).num_found);
  if (place && config_.smooths)
    gone_[id] = {{{id, place->point_in_world, place->cov, false, num_found}, is_settled(*feature, filter, config_)},
                 landmarks_.at(id)};
  forget(id);
}

Recording ImageLocalizer::recording() const {
  Recording recording{record_, kept_, {}, number_of_, period_s(), {}};
  for (const auto& [id, gone] : gone_) recording.gone.push_back(gone.point);
  recording.num_used = [this](long id) {
    const auto at = landmarks_.find(id);
    if (at != landmarks_.end()) return static_cast<std::size_t>(at->second.num_found);
    const auto gone = gone_.find(id);
    return gone == gone_.end() ? 0 : gone->second.point.point.num_seen;
  };
  return recording;
}

/// Landmarks merged by a closed loop appear in the map once.
void ImageLocalizer::leave_out_joined(const WholePath& whole, Localization& result) const {
  if (result.num_loops == 0) return;
  const std::vector<long>& solved = whole.smoothed.ids;
  std::erase_if(result.map, [&](const MapPoint& point) {
    const auto before = number_of_.find(point.id);
    return before != number_of_.end() && !std::ranges::binary_search(solved, point.id) &&
           std::ranges::binary_search(solved, before->second);
  });
}

void ImageLocalizer::sum_up(Localization& result) const {
  result.is_of_images = true;
  result.lacks_circle = lacks_circle_;
  result.still_share = still_.still_share();
  result.num_repeated = num_repeated_;
  result.sigma_px = config_.features.sigma_floor_px;
  result.num_alike = num_alike_;
  LocalizeConfig config = config_;
  if (!given_.empty()) config.target.points = given_;
  const Recording kept = recording();
  std::optional<WholePath> whole;
  if (config_.smooths) whole = whole_path(kept, engine_, config, result);
  engine_.sum_up(kept.num_used, result);
  result.nis_per_dof *= std::pow(config_.features.sigma_floor_px / result.sigma_px, 2);
  take_over(whole, kept, engine_, config, result);
  if (whole) leave_out_joined(*whole, result);
  result.known_shift = known_shift(result.map, given_);
}

void ImageLocalizer::save_map(Localization& result) const {
  SavedMap& map = result.saved_map;
  for (const MapPoint& point : result.map) {
    const auto at = landmarks_.find(point.id);
    const auto gone = gone_.find(point.id);
    if (at == landmarks_.end() && gone == gone_.end()) continue;
    const Landmark& landmark = at != landmarks_.end() ? at->second : gone->second.landmark;
    const Rigid3& from =
        landmark.is_saved ? landmark.world_from_first_cam : result.path[landmark.first_step].world_from_cam;
    constexpr double sure = 0.05;  // of the distance: less certain ones would be searched at the wrong position
    if (!(std::sqrt(point.cov.trace()) < sure * (point.point_in_world - from.translation).norm())) continue;
    map.points.push_back({point.id, point.point_in_world, point.cov_in_map.value_or(point.cov),
                          look_of(landmark, point.point_in_world, from)});
  }
  for (const auto& [id, saved] : saved_)  // points of the earlier map that were not seen this time
    if (std::ranges::find(map.points, id, &SavedPoint::id) == map.points.end())
      if (const auto at = std::ranges::find(config_.map->points, id, &SavedPoint::id); at != config_.map->points.end())
        map.points.push_back(*at);
  std::ranges::sort(map.points, {}, &SavedPoint::id);
  map.keyframes = keyframes_.saved(result.path);
}

}  // namespace alidade
