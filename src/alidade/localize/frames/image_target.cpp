#include "alidade/localize/frames/image_target.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/board_detector/find_board.h"
#include "alidade/imaging/rectangles.h"

namespace alidade {
namespace {

constexpr double max_chi2_per_dof = 6.9;  // 99.9 % of the two degrees of freedom of four corners

int dof_of(std::size_t num_points) { return 2 * static_cast<int>(num_points) - 6; }

std::optional<SeenTarget> posed(const Camera& camera, std::vector<FeatureObservation> observations,
                                const LocalizeTarget& target, const KnownPoseConfig& config) {
  SeenTarget seen{std::move(observations), {}};
  seen.starts = poses_from_known(camera, seen.observations, target.points, config);
  if (seen.starts.empty()) return std::nullopt;
  if (seen.starts.front().cost > max_chi2_per_dof * std::max(1, dof_of(seen.observations.size()))) return std::nullopt;
  return seen;
}

/// Of the possible corner orders, those with x pointing to the right; returns the one that fits best.
std::optional<SeenTarget> posed_rectangle(const Camera& camera, const SeenRectangle& rectangle,
                                          const LocalizeTarget& target, const KnownPoseConfig& config) {
  std::optional<SeenTarget> best;
  for (std::size_t first = 0; first < 4; ++first) {
    const Eigen::Vector2d x_axis = rectangle.corners_px[(first + 1) % 4] - rectangle.corners_px[first];
    if (!(x_axis.x() > 0.0)) continue;
    std::vector<FeatureObservation> observations;
    for (std::size_t k = 0; k < 4; ++k)
      observations.push_back({static_cast<long>(k), rectangle.corners_px[(first + k) % 4], rectangle.sigma_px});
    KnownPoseConfig own = config;
    own.sigma_px = std::max(rectangle.sigma_px, config.sigma_px);
    auto seen = posed(camera, std::move(observations), target, own);
    if (seen && (!best || seen->starts.front().cost < best->starts.front().cost)) best = std::move(seen);
  }
  return best;
}

std::optional<SeenTarget> find_rectangle(const cv::Mat& grey, const Camera& camera, const LocalizeTarget& target,
                                         const KnownPoseConfig& config) {
  struct Candidate {
    SeenTarget seen;
    Eigen::Vector2d centre_px;
    double score, size_px;
  };
  std::vector<Candidate> candidates;
  constexpr double paper_sigma = 5.0;  // scatter of print, light and noise inside
  for (const SeenRectangle& rectangle : find_rectangles(grey, camera)) {
    auto seen = posed_rectangle(camera, rectangle, target, config);
    if (!seen) continue;
    const auto& at = rectangle.corners_px;
    candidates.push_back({std::move(*seen), 0.25 * (at[0] + at[1] + at[2] + at[3]),
                          std::abs(rectangle.contrast) / (paper_sigma + rectangle.inside_sigma),
                          (at[2] - at[0]).norm()});
  }
  const auto best = std::ranges::max_element(candidates, {}, &Candidate::score);
  if (best == candidates.end()) return std::nullopt;
  constexpr double nearly_as_good = 0.7;  // the same print in other light
  for (const Candidate& other : candidates) {
    const bool is_elsewhere = (other.centre_px - best->centre_px).norm() > 0.5 * std::min(other.size_px, best->size_px);
    best->seen.num_alike += is_elsewhere && other.score > nearly_as_good * best->score ? 1u : 0u;
  }
  return std::move(best->seen);
}

std::optional<SeenTarget> find_board_points(const cv::Mat& grey, const Camera& camera, const LocalizeTarget& target,
                                            const KnownPoseConfig& config) {
  const BoardDetection found = find_board(grey, *target.board);
  if (!found.found()) return std::nullopt;
  std::vector<FeatureObservation> observations;
  for (const Corner& corner : found.view.corners)
    observations.push_back({corner.index, corner.px, std::sqrt(0.5 * corner.cov.trace())});
  return posed(camera, std::move(observations), target, config);
}

/// Vertex of the parabola through three neighbours, relative to the central one.
double top_of(double before, double at, double after) {
  const double bend = before - 2.0 * at + after;
  return bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
}

/// Locates each patch where the image correlates best with it.
std::optional<SeenTarget> find_patches(const cv::Mat& grey, const Camera& camera, const LocalizeTarget& target,
                                       const KnownPoseConfig& config) {
  constexpr double min_correlation = 0.75;
  std::vector<FeatureObservation> observations;
  for (std::size_t i = 0; i < target.patches.size(); ++i) {
    const GreyPatch& patch = target.patches[i];
    const cv::Mat look(patch.height_px, patch.width_px, CV_8U, const_cast<std::uint8_t*>(patch.grey.data()));
    if (look.empty() || look.cols >= grey.cols || look.rows >= grey.rows) continue;
    cv::Mat likeness;
    cv::matchTemplate(grey, look, likeness, cv::TM_CCOEFF_NORMED);
    double best = 0.0;
    cv::Point at;
    cv::minMaxLoc(likeness, nullptr, &best, nullptr, &at);
    if (!(best >= min_correlation)) continue;
    const auto like = [&](int dx, int dy) -> double {
      const int u = std::clamp(at.x + dx, 0, likeness.cols - 1), v = std::clamp(at.y + dy, 0, likeness.rows - 1);
      return likeness.at<float>(v, u);
    };
    const Eigen::Vector2d top(at.x + top_of(like(-1, 0), best, like(1, 0)),
                              at.y + top_of(like(0, -1), best, like(0, 1)));
    const Eigen::Vector2d centre(0.5 * (patch.width_px - 1), 0.5 * (patch.height_px - 1));
    observations.push_back({target.points[i].id, top + centre, config.sigma_px});
  }
  return posed(camera, std::move(observations), target, config);
}

}  // namespace

LocalizeTarget rectangle_target(double width_m, double height_m, double sigma_m) {
  LocalizeTarget target;
  target.rectangle_m = {width_m, height_m};
  const double x = 0.5 * width_m, y = 0.5 * height_m;
  target.points = {
      {0, {-x, -y, 0.0}, sigma_m}, {1, {x, -y, 0.0}, sigma_m}, {2, {x, y, 0.0}, sigma_m}, {3, {-x, y, 0.0}, sigma_m}};
  return target;
}

std::optional<SeenTarget> find_target(const cv::Mat& grey, const Camera& camera, const LocalizeTarget& target,
                                      const KnownPoseConfig& config) {
  if (target.rectangle_m) return find_rectangle(grey, camera, target, config);
  if (target.board) return find_board_points(grey, camera, target, config);
  return find_patches(grey, camera, target, config);
}

}  // namespace alidade
