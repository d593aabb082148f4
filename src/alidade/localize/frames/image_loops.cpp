#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/localize/frames/image_localizer.h"
#include "alidade/localize/known_pose.h"

// Recognition of landmarks that left the map, when the camera returns: the loop is closed at the end.

namespace alidade {
namespace {

constexpr std::size_t long_after = 100;  // images: shorter gaps are cheap to bridge and drift little
constexpr std::size_t min_agreeing = 8, most_images = 3;

struct Agreement {
  Rigid3 world_from_cam;
  std::vector<std::size_t> agreeing;
};

/// The pose from which most of these map points project within `near_px` of their observations. Empty: fewer than
/// eight, or fewer than half.
std::optional<Agreement> agreement(const Camera& camera, std::span<const LandmarkSeen> seen,
                                   std::span<const KnownPoint> known, double sigma_px, double near_px) {
  std::vector<FeatureObservation> observations;
  for (const LandmarkSeen& each : seen) observations.push_back({each.id, each.px, sigma_px});
  std::optional<Agreement> best;
  for (const StartHypothesis& start : poses_from_known(camera, observations, known, {.sigma_px = sigma_px})) {
    Agreement found{start.motion.world_from_cam, {}};
    const Rigid3 cam_from_world = found.world_from_cam.inverse();
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const auto px = project(camera, cam_from_world * known[i].point_in_world);
      if (px && (*px - seen[i].px).norm() < near_px) found.agreeing.push_back(i);
    }
    if (!best || found.agreeing.size() > best->agreeing.size()) best = std::move(found);
  }
  if (!best || best->agreeing.size() < min_agreeing || 2 * best->agreeing.size() < seen.size()) return std::nullopt;
  return best;
}

}  // namespace

/// Describes an image at each place along the way, and compares it with those of long before.
void ImageLocalizer::close_loop(const cv::Mat& smoothed, double usual_depth_m) {
  if (!config_.smooths) return;
  const Rigid3& world_from_cam = engine_.best().motion().world_from_cam;
  const bool is_near = last_described_ &&
                       (last_described_->translation - world_from_cam.translation).norm() <
                           config_.features.near_share * usual_depth_m &&
                       last_described_->rotation.angularDistance(world_from_cam.rotation) < config_.features.near_rad;
  if (is_near) return;
  last_described_ = world_from_cam;
  if (!gone_.empty() && num_taken_ > long_after) recognise(smoothed);
  std::vector<LandmarkSeen> seen;
  for (const auto& [id, landmark] : landmarks_)
    if (!landmark.is_known && landmark.last_found == frame_) seen.push_back({id, landmark.last_px});
  std::ranges::sort(seen, {}, &LandmarkSeen::id);
  descriptions_.add(smoothed, num_taken_, seen);
}

/// Recognises landmarks that left the map: descriptors, then positions with a pose, then patches must agree.
void ImageLocalizer::recognise(const cv::Mat& smoothed) {
  constexpr double corner_px = 1.5, near_px = 6.0;  // a corner of a downsampled image is off by a pixel or two
  for (const std::vector<LandmarkSeen>& matches :
       descriptions_.matches(smoothed, num_taken_ - long_after, min_agreeing, most_images)) {
    std::vector<LandmarkSeen> seen;
    std::vector<KnownPoint> known;
    for (const LandmarkSeen& match : matches)
      if (const auto gone = gone_.find(match.id); gone != gone_.end() && gone->second.point.is_linear) {
        seen.push_back(match);
        known.push_back({match.id, gone->second.point.point.point_in_world, 0.0});
      }
    if (seen.size() < min_agreeing) continue;
    const auto agreed = agreement(engine_.camera(), seen, known, corner_px, near_px);
    if (agreed && take_recognised(smoothed, agreed->world_from_cam)) return;
  }
}

/// From a pose in the old map, re-enters those of its landmarks that are found, as new ones. Returns whether it did.
bool ImageLocalizer::take_recognised(const cv::Mat& smoothed, const Rigid3& world_from_cam) {
  constexpr double around_px = 3.0, sigma_px = 0.5, near_px = 2.0, min_correlation = 0.85;
  const Camera& camera = engine_.camera();
  const Rigid3 cam_from_world = world_from_cam.inverse();
  std::vector<LandmarkSeen> seen;
  std::vector<KnownPoint> known;
  for (const auto& [id, gone] : gone_) {
    const Eigen::Vector3d& point = gone.point.point.point_in_world;
    if (!gone.point.is_linear || gone.landmark.first_step + long_after > num_taken_) continue;
    const auto px = project(camera, cam_from_world * point);
    constexpr double margin_px = ReferencePatch::margin_px + 1.0;
    if (!px || px->minCoeff() < margin_px || px->x() > smoothed.cols - 1 - margin_px ||
        px->y() > smoothed.rows - 1 - margin_px || !is_shown(*px))
      continue;
    const auto warp = here_from_first(gone.landmark, camera, world_from_cam, point);
    const auto view = warp ? gone.landmark.patch.seen_through(*warp) : std::nullopt;
    if (!view) continue;
    const Eigen::Vector2d offset_px = *warp * gone.landmark.offset_px;
    const auto match = find_patch(smoothed, *view, *px - offset_px, around_px * around_px * Eigen::Matrix2d::Identity(),
                                  {3.0, min_correlation});
    if (!match) continue;
    seen.push_back({id, match->px + offset_px});
    known.push_back({id, point, 0.0});
  }
  const auto agreed = agreement(camera, seen, known, sigma_px, near_px);
  if (!agreed) return false;
  for (const std::size_t i : agreed->agreeing) enter_again(smoothed, seen[i]);
  return true;
}

/// A recognised landmark enters as a new one, as the path has drifted meanwhile.
void ImageLocalizer::enter_again(const cv::Mat& smoothed, const LandmarkSeen& seen) {
  const auto before = number_of_.find(seen.id);
  const long number = before == number_of_.end() ? seen.id : before->second;
  const auto latest = latest_.find(number);
  if (latest != latest_.end() && landmarks_.contains(latest->second)) return;
  const long id = next_id_;
  if (!make_room() || !add_landmark(smoothed, seen.px, usual_depth_m())) return;
  number_of_[id] = number;
  latest_[number] = id;
}

}  // namespace alidade
