#include "alidade/localize/path/keyframes.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

constexpr double min_sigma = 4.0;  // grey values of a thumbnail: less is no texture
constexpr std::size_t max_keyframes = 200;

/// Normalised correlation of two thumbnails at a shift, over their overlap.
double correlation_at(const Thumbnail& first, const Thumbnail& second, int du, int dv) {
  double product = 0.0, squares_a = 0.0, squares_b = 0.0, sum_a = 0.0, sum_b = 0.0;
  int num = 0;
  for (int y = std::max(0, -dv); y < std::min(Thumbnail::height, Thumbnail::height - dv); ++y) {
    const float* const a = &first.grey[static_cast<std::size_t>(y * Thumbnail::width)];
    const float* const b = &second.grey[static_cast<std::size_t>((y + dv) * Thumbnail::width)];
    float row[5] = {};
    const int from = std::max(0, -du), to = std::min(Thumbnail::width, Thumbnail::width - du);
    for (int x = from; x < to; ++x) {
      row[0] += a[x] * b[x + du];
      row[1] += a[x] * a[x];
      row[2] += b[x + du] * b[x + du];
      row[3] += a[x];
      row[4] += b[x + du];
    }
    product += row[0];
    squares_a += row[1];
    squares_b += row[2];
    sum_a += row[3];
    sum_b += row[4];
    num += to - from;
  }
  const double spread = (squares_a - sum_a * sum_a / num) * (squares_b - sum_b * sum_b / num);
  return spread > 0.0 ? (product - sum_a * sum_b / num) / std::sqrt(spread) : -1.0;
}

double distance_rad(const Rigid3& a, const Rigid3& b) { return a.rotation.angularDistance(b.rotation); }

/// Rotates the pose such that the image centre looks where the pixel `centre − shift_px` looked before.
Rigid3 turned(const Camera& camera, const Rigid3& world_from_cam, const Eigen::Vector2d& shift_px) {
  const Eigen::Vector2d centre(0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1));
  const auto from = unproject(camera, centre), to = unproject(camera, centre - shift_px);
  if (!from || !to) return world_from_cam;
  Rigid3 result = world_from_cam;
  result.rotation = (world_from_cam.rotation * rotation_between(*from, *to)).normalized();
  return result;
}

}  // namespace

Thumbnail thumbnail_of(const cv::Mat& grey) {
  cv::Mat bytes, small, as_float;
  cv::resize(grey, small, {Thumbnail::width, Thumbnail::height}, 0.0, 0.0, cv::INTER_AREA);
  small.convertTo(as_float, CV_32F);
  cv::GaussianBlur(as_float, as_float, {5, 5}, 1.0);
  as_float -= cv::mean(as_float)[0];
  Thumbnail thumbnail;
  std::copy(as_float.begin<float>(), as_float.end<float>(), thumbnail.grey.begin());
  for (const float value : thumbnail.grey) thumbnail.energy += value * value;
  return thumbnail;
}

ThumbnailMatch match_thumbnails(const Thumbnail& first, const Thumbnail& second) {
  ThumbnailMatch best;
  constexpr double min_energy = min_sigma * min_sigma * Thumbnail::width * Thumbnail::height;
  if (first.energy < min_energy || second.energy < min_energy) return best;
  constexpr int reach_u = 12, reach_v = 9;  // a third of the image
  for (int dv = -reach_v; dv <= reach_v; ++dv) {
    for (int du = -reach_u; du <= reach_u; ++du) {
      const double correlation = correlation_at(first, second, du, dv);
      if (correlation > best.correlation) best = {correlation, {du, dv}};
    }
  }
  return best;
}

void KeyframeStore::offer(const cv::Mat& grey, const Rigid3& world_from_cam, double near_m, double near_rad,
                          std::size_t step) {
  if (keyframes_.size() >= max_keyframes) return;
  const bool is_near = std::ranges::any_of(keyframes_, [&](const Keyframe& keyframe) {
    return (keyframe.world_from_cam.translation - world_from_cam.translation).norm() < near_m &&
           distance_rad(keyframe.world_from_cam, world_from_cam) < near_rad;
  });
  if (is_near) return;
  keyframes_.push_back({world_from_cam, thumbnail_of(grey), step});
}

void KeyframeStore::add(const SavedKeyframe& saved) {
  Thumbnail thumbnail;
  double mean = 0.0;
  for (const std::uint8_t grey : saved.thumbnail.grey) mean += grey / static_cast<double>(thumbnail.grey.size());
  for (std::size_t i = 0; i < thumbnail.grey.size(); ++i) {
    thumbnail.grey[i] = static_cast<float>(saved.thumbnail.grey[i] - mean);
    thumbnail.energy += thumbnail.grey[i] * thumbnail.grey[i];
  }
  keyframes_.push_back({saved.world_from_cam, thumbnail, {}});
}

std::vector<SavedKeyframe> KeyframeStore::saved(std::span<const PathStep> path) const {
  std::vector<SavedKeyframe> all;
  for (const Keyframe& keyframe : keyframes_) {
    SavedKeyframe saved{keyframe.world_from_cam, {Thumbnail::width, Thumbnail::height, {}}};
    if (keyframe.step) saved.world_from_cam = path[*keyframe.step].world_from_cam;
    constexpr double grey = 128.0;  // mid-grey, half of the range of a byte; the mean is irrelevant
    for (const float value : keyframe.thumbnail.grey)
      saved.thumbnail.grey.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(value + grey), 0L, 255L)));
    all.push_back(std::move(saved));
  }
  return all;
}

std::vector<Rigid3> KeyframeStore::candidates(const cv::Mat& grey, const Camera& camera, std::size_t most) const {
  const Thumbnail now = thumbnail_of(grey);
  std::vector<std::pair<ThumbnailMatch, const Keyframe*>> matches;
  for (const Keyframe& keyframe : keyframes_) {
    const ThumbnailMatch match = match_thumbnails(keyframe.thumbnail, now);
    constexpr double min_correlation = 0.4;
    if (match.correlation > min_correlation) matches.emplace_back(match, &keyframe);
  }
  std::ranges::sort(matches, std::greater{}, [](const auto& entry) { return entry.first.correlation; });
  std::vector<Rigid3> poses;
  for (const auto& [match, keyframe] : matches) {
    if (poses.size() == most) break;
    const Eigen::Vector2d shift_px(match.shift.x() * camera.width_px / static_cast<double>(Thumbnail::width),
                                   match.shift.y() * camera.height_px / static_cast<double>(Thumbnail::height));
    poses.push_back(turned(camera, keyframe->world_from_cam, shift_px));
  }
  return poses;
}

}  // namespace alidade
