#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "alidade/target/target_search.h"

namespace alidade {
namespace {

struct Match {
  double correlation = -1.0;
  double rival = -1.0;                           ///< Best anywhere else.
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< Centre of the pattern, in the window.
  Eigen::Vector2d rival_px = Eigen::Vector2d::Zero();
};

/// Vertex of the parabola through three values at −1, 0, 1.
double vertex(double before, double here, double after) {
  const double bend = before - 2.0 * here + after;
  return bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
}

Match match_at(const cv::Mat& window, const cv::Mat& pattern) {
  Match match;
  if (pattern.cols >= window.cols || pattern.rows >= window.rows) return match;
  cv::Mat correlation;
  cv::matchTemplate(window, pattern, correlation, cv::TM_CCOEFF_NORMED);
  cv::patchNaNs(correlation, -1.0);
  cv::Point at;
  cv::minMaxLoc(correlation, nullptr, &match.correlation, nullptr, &at);
  Eigen::Vector2d fine(at.x, at.y);
  if (at.x > 0 && at.x + 1 < correlation.cols)
    fine.x() += vertex(static_cast<double>(correlation.at<float>(at.y, at.x - 1)), match.correlation,
                       static_cast<double>(correlation.at<float>(at.y, at.x + 1)));
  if (at.y > 0 && at.y + 1 < correlation.rows)
    fine.y() += vertex(static_cast<double>(correlation.at<float>(at.y - 1, at.x)), match.correlation,
                       static_cast<double>(correlation.at<float>(at.y + 1, at.x)));
  const Eigen::Vector2d to_centre(0.5 * (pattern.cols - 1), 0.5 * (pattern.rows - 1));
  match.px = fine + to_centre;
  cv::rectangle(correlation, {at.x - pattern.cols / 2, at.y - pattern.rows / 2, pattern.cols, pattern.rows},
                cv::Scalar(-1.0), cv::FILLED);
  cv::minMaxLoc(correlation, nullptr, &match.rival, nullptr, &at);
  match.rival_px = Eigen::Vector2d(at.x, at.y) + to_centre;
  return match;
}

cv::Mat scaled(const cv::Mat& pattern, double scale) {
  cv::Mat result;
  // A size, not a factor: only so does the centre stay in the centre.
  const cv::Size size(static_cast<int>(std::lround(scale * pattern.cols)),
                      static_cast<int>(std::lround(scale * pattern.rows)));
  cv::resize(pattern, result, size, 0.0, 0.0, scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

/// Noise over gradients: the covariance of a displacement estimated from all pixels.
Eigen::Matrix2d covariance_of(const cv::Mat& pattern, double correlation) {
  cv::Mat gradient_u, gradient_v;
  cv::Sobel(pattern, gradient_u, CV_32F, 1, 0, 3, 0.125);
  cv::Sobel(pattern, gradient_v, CV_32F, 0, 1, 3, 0.125);
  cv::Scalar mean, sigma;
  cv::meanStdDev(pattern, mean, sigma);
  Eigen::Matrix2d information;
  information << gradient_u.dot(gradient_u), gradient_u.dot(gradient_v), gradient_u.dot(gradient_v),
      gradient_v.dot(gradient_v);
  const double noise_variance = sigma[0] * sigma[0] * (1.0 / (correlation * correlation) - 1.0);
  const double interpolation_px = 0.15;  // what scaling and a parabola through three correlations leave (tested)
  return noise_variance * information.inverse() + interpolation_px * interpolation_px * Eigen::Matrix2d::Identity();
}

}  // namespace

TargetDetection find_target_pattern(const cv::Mat& grey, const cv::Mat& pattern, const TargetLook& look,
                                    const std::optional<TargetExpectation>& expected, double& scale) {
  const double half_px = 0.5 * scale * std::max(pattern.cols, pattern.rows);
  const SearchWindow window = search_window(grey, expected, 1.5 * half_px + 2.0);
  if (window.width <= 0 || window.height <= 0) return lost_target("out of the image");
  cv::Mat image;
  grey({window.u, window.v, window.width, window.height}).convertTo(image, CV_32F);
  constexpr std::array<double, 5> changes{0.82, 0.905, 1.0, 1.105, 1.22};
  std::array<Match, changes.size()> matches;
  std::size_t best = 0;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const double size_px = scale * changes[i] * std::min(pattern.cols, pattern.rows);
    if (size_px >= 8.0) matches[i] = match_at(image, scaled(pattern, scale * changes[i]));
    if (matches[i].correlation > matches[best].correlation) best = i;
  }
  double change = changes[best];
  if (best > 0 && best + 1 < changes.size()) {
    const double off = vertex(matches[best - 1].correlation, matches[best].correlation, matches[best + 1].correlation);
    change *= std::pow(changes[3], off);
    matches[best] = match_at(image, scaled(pattern, scale * change));
  }
  const Match& match = matches[best];
  if (match.correlation < look.min_correlation) return lost_target("not in the image");
  const Eigen::Vector2d corner = window.corner();
  if (match.rival > match.correlation - look.min_margin)
    return lost_target(two_candidates(match.px + corner, match.rival_px + corner));
  TargetDetection found;
  found.px = match.px + corner;
  found.score = match.correlation;
  scale *= change;
  const cv::Mat here = scaled(pattern, scale);
  found.cov = covariance_of(here, match.correlation);
  found.radius_px = std::sqrt(static_cast<double>(here.total()) / 3.141592653589793);
  return found;
}

}  // namespace alidade
