#include "alidade/localize/frames/image_mask.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace alidade {
namespace {

/// Pixels brighter than an eighth of the bright parts, without isolated noise pixels.
cv::Mat bright_part(const cv::Mat& grey) {
  std::vector<std::uint8_t> values(grey.begin<std::uint8_t>(), grey.end<std::uint8_t>());
  const auto bright = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 9 / 10);
  std::ranges::nth_element(values, bright);
  const cv::Mat is_bright = grey > std::max(8, *bright / 8);
  cv::Mat opened;
  cv::morphologyEx(is_bright, opened, cv::MORPH_OPEN, cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5}));
  return opened;
}

/// Empty: the bright part is not a circle, or is all of the image.
cv::Mat circle_part(const cv::Mat& grey) {
  constexpr double min_outside = 0.03, min_filled = 0.9;  // of the image; of the part of the circle in it
  std::vector<cv::Point> points;
  cv::findNonZero(bright_part(grey), points);
  if (points.empty()) return {};
  cv::Point2f centre;
  float radius_px = 0.0f;
  cv::minEnclosingCircle(points, centre, radius_px);
  cv::Mat shown(grey.size(), CV_8U, cv::Scalar(0)), hull_part(grey.size(), CV_8U, cv::Scalar(0));
  cv::circle(shown, centre, static_cast<int>(radius_px), cv::Scalar(255), cv::FILLED);
  std::vector<cv::Point> hull;
  cv::convexHull(points, hull);
  cv::fillConvexPoly(hull_part, hull, cv::Scalar(255));
  const double num_shown = cv::countNonZero(shown), num_hull = cv::countNonZero(hull_part);
  if (num_shown > (1.0 - min_outside) * static_cast<double>(grey.total()) || num_hull < min_filled * num_shown)
    return {};
  return shown;
}

}  // namespace

ShownPart shown_part(const LocalizeConfig& config, const cv::Mat& grey, int margin_px) {
  cv::Mat shown;
  if (config.masks_circle) shown = circle_part(grey);
  const bool lacks_circle = config.masks_circle && shown.empty();
  if (config.mask) {
    const cv::Mat mask(config.mask->height_px, config.mask->width_px, CV_8U,
                       const_cast<std::uint8_t*>(config.mask->shows.data()));
    const cv::Mat is_shown = mask > 0;
    shown = shown.empty() ? is_shown : cv::Mat(shown & is_shown);
  }
  if (shown.empty()) return {{}, lacks_circle};
  cv::erode(shown, shown, cv::getStructuringElement(cv::MORPH_RECT, {2 * margin_px + 1, 2 * margin_px + 1}));
  return {{shown.cols, shown.rows, {shown.begin<std::uint8_t>(), shown.end<std::uint8_t>()}}, lacks_circle};
}

}  // namespace alidade
