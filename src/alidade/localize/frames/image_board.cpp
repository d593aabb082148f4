#include <algorithm>
#include <limits>
#include <opencv2/core.hpp>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/frames/image_localizer.h"

// The corners of a board look alike: by its surroundings, one may be confused with its diagonal neighbour, and all
// together with a displaced board.

namespace alidade {

/// Whether the search regions of corners reach half-way to the nearest other corner.
bool ImageLocalizer::may_mistake_corners() const {
  constexpr double sigmas = 3.0;  // radius of the search for a patch
  std::vector<Eigen::Vector2d> px;
  std::vector<double> reach_px;
  for (const KnownPoint& point : given_) {
    const auto expected = engine_.best().expected(point.id);
    if (!expected) continue;
    px.push_back(expected->px);
    reach_px.push_back(sigmas * std::sqrt(symmetric_eigenvalues(expected->S)[1]));
  }
  if (px.size() < 2) return false;
  std::vector<double> apart_px;
  for (std::size_t i = 0; i < px.size(); ++i) {
    double nearest2 = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < px.size(); ++j)
      if (j != i) nearest2 = std::min(nearest2, (px[j] - px[i]).squaredNorm());
    apart_px.push_back(std::sqrt(nearest2));
  }
  return median_of(std::move(reach_px)) > 0.5 * median_of(std::move(apart_px));
}

/// The target in this image, detected once.
const std::optional<SeenTarget>& ImageLocalizer::target_now(const cv::Mat& smoothed) {
  if (!seen_now_) seen_now_ = seen_target(smoothed);
  return *seen_now_;
}

/// Its corners as detected on the whole board, if single ones may be confused. Null: search each by its surroundings.
const std::vector<FeatureObservation>* ImageLocalizer::corners_of_board(const cv::Mat& smoothed) {
  if (!config_.target.board || !may_mistake_corners()) return nullptr;
  const std::optional<SeenTarget>& seen = target_now(smoothed);
  return seen ? &seen->observations : nullptr;
}

/// Completes the last entries of `tried_` and `in_view_`, which are for this corner.
void ImageLocalizer::take_corner(const std::vector<FeatureObservation>& corners,
                                 std::vector<FeatureObservation>& observations) {
  const auto found = std::ranges::find(corners, tried_.back().id, &FeatureObservation::id);
  if (found == corners.end()) return;
  tried_.back().found_px = in_view_.back() = found->px;
  observations.push_back({found->id, found->px, std::hypot(found->sigma_px, config_.features.sigma_floor_px)});
}

}  // namespace alidade
