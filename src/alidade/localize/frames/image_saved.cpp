#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/estimation/median.h"
#include "alidade/localize/frames/image_localizer.h"
#include "alidade/localize/frames/known_map.h"

// The map of an earlier run: the path starts in it, and its points enter the filter where they should be visible.

namespace alidade {

void ImageLocalizer::take_saved(const SavedMap& map) {
  for (const KnownPoint& point : known_points(map)) {
    const auto at = std::ranges::find(map.points, point.id, &SavedPoint::id);
    if (!at->look) continue;
    saved_[point.id] = {point, saved_landmark(point.id, *at->look, point.point_in_world)};
    next_id_ = std::max(next_id_, point.id + 1);
  }
  for (const SavedKeyframe& keyframe : map.keyframes) keyframes_.add(keyframe);
}

/// Adds saved points that should be visible and are not in the filter; those not found for long make room.
void ImageLocalizer::enter_saved() {
  if (saved_.empty()) return;
  constexpr long long_ago = 15;  // frames
  const Camera& camera = engine_.camera();
  const Rigid3 cam_from_world = engine_.best().motion().world_from_cam.inverse();
  std::size_t num = 0;
  std::vector<long> leaving;
  for (const auto& [id, landmark] : landmarks_) {
    if (!landmark.is_saved || !engine_.best().has(id)) continue;
    ++num;
    if (landmark.last_found + long_ago < frame_) leaving.push_back(id);
  }
  std::ranges::sort(leaving);
  for (const auto& [id, saved] : saved_) {
    if (engine_.best().has(id)) continue;
    const auto px = project(camera, cam_from_world * saved.point.point_in_world);
    constexpr double margin_px = PatchView::half_px + 2.0;
    if (!px || px->minCoeff() < margin_px || px->x() > camera.width_px - 1 - margin_px ||
        px->y() > camera.height_px - 1 - margin_px || !is_shown(*px))
      continue;
    if (num >= max_saved_at_once) {
      if (leaving.empty()) return;
      forget(leaving.back());
      leaving.pop_back();
      --num;
    }
    engine_.filters().add_known(id, saved.point.point_in_world, saved.point.sigma_m);
    if (!engine_.best().has(id)) return;  // no room
    ++num;
    landmarks_[id] = saved.landmark;
    landmarks_[id].last_found = frame_;
    if (std::ranges::find(given_, id, &KnownPoint::id) == given_.end()) given_.push_back(saved.point);
  }
}

/// Starts at the first keyframe from which the map is found in the image.
bool ImageLocalizer::start_in_map(const cv::Mat& smoothed) {
  std::vector<double> depths;
  for (const auto& [id, saved] : saved_) depths.push_back(saved.landmark.first_distance_m);
  if (depths.empty()) return false;
  for (const StartHypothesis& from : likely_places(smoothed, median_of(std::move(depths)))) {
    record_ = {};
    begin_at({{from}});
    PathStep found;
    if (try_from(smoothed, from, found)) {
      num_found_now_ = found.num_tracked;
      add_new(smoothed);
      return true;
    }
    landmarks_.clear();
  }
  return false;
}

}  // namespace alidade
