#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>

#include "alidade/estimation/median.h"
#include "alidade/localize/frames/image_localizer.h"
#include "alidade/localize/frames/image_mask.h"

// Which part of the images shows the scene, and which images are new.

namespace alidade {

bool ImageLocalizer::is_shown(const Eigen::Vector2d& px) const {
  if (shown_.shows.empty()) return true;
  const int u = static_cast<int>(std::lround(px.x())), v = static_cast<int>(std::lround(px.y()));
  return u >= 0 && v >= 0 && u < shown_.width_px && v < shown_.height_px &&
         shown_.shows[static_cast<std::size_t>(v) * static_cast<std::size_t>(shown_.width_px) +
                      static_cast<std::size_t>(u)] != 0;
}

/// Whether the image is identical to the last one: no camera takes two with the same noise.
bool ImageLocalizer::shows_last(const cv::Mat& grey) {
  const auto bytes = static_cast<std::size_t>(grey.cols);
  bool is_same = last_image_.size() == bytes * static_cast<std::size_t>(grey.rows);  // same camera: same width
  const auto kept = [&](int v) { return last_image_.data() + bytes * static_cast<std::size_t>(v); };
  for (int v = 0; is_same && v < grey.rows; ++v) is_same = std::memcmp(grey.ptr(v), kept(v), bytes) == 0;
  if (is_same) return true;
  last_image_.resize(bytes * static_cast<std::size_t>(grey.rows));
  for (int v = 0; v < grey.rows; ++v) std::memcpy(kept(v), grey.ptr(v), bytes);
  return false;
}

/// Whether the features found in the last image are now predicted elsewhere. A camera that stands still in a noiseless
/// scene also repeats its image.
bool ImageLocalizer::should_move() const {
  constexpr double still_px = 0.3;
  std::vector<double> moved_px;
  for (const auto& [id, landmark] : landmarks_) {
    const auto expected = engine_.best().expected(id);
    if (expected && landmark.num_found > 0) moved_px.push_back((expected->px - landmark.last_px).norm());
  }
  return !moved_px.empty() && median_of(std::move(moved_px)) > still_px;
}

/// Updates the mask: the given one, or the circle of the first image that shows one; without still parts. Removes
/// landmarks last found in still parts: they are not points of the scene.
void ImageLocalizer::mask(const cv::Mat& grey, const cv::Mat& smoothed) {
  constexpr int margin_px = PatchView::half_px + 2;
  if (given_mask_.shows.empty()) {
    ShownPart part = shown_part(config_, grey, margin_px);
    given_mask_ = std::move(part.mask);
    lacks_circle_ = part.lacks_circle;
    if (!given_mask_.shows.empty()) shown_ = given_mask_;
  }
  if (!config_.masks_still || !still_.add(smoothed)) return;
  const cv::Mat moves = still_.shown(margin_px);
  shown_ = {moves.cols, moves.rows, {moves.begin<std::uint8_t>(), moves.end<std::uint8_t>()}};
  for (std::size_t i = 0; i < given_mask_.shows.size(); ++i) shown_.shows[i] &= given_mask_.shows[i];
  if (!engine_.has_begun()) return;
  std::vector<long> still;
  for (const auto& [id, landmark] : landmarks_)
    if (!landmark.is_known && !is_shown(landmark.last_px)) still.push_back(id);
  std::ranges::sort(still);
  for (const long id : still) {
    forget(id);
    record_.left(id);
  }
}

}  // namespace alidade
