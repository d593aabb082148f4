#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/board/dictionary.h"
#include "alidade/target/target_search.h"

namespace alidade {
namespace {

/// The intersection of a quadrangle's diagonals: the centre of the square that it is an image of.
Eigen::Vector2d crossing_of_diagonals(const std::vector<cv::Point2f>& corners) {
  const auto homogeneous = [&](std::size_t i) {
    return Eigen::Vector3d(static_cast<double>(corners[i].x), static_cast<double>(corners[i].y), 1.0);
  };
  const Eigen::Vector3d crossing = homogeneous(0).cross(homogeneous(2)).cross(homogeneous(1).cross(homogeneous(3)));
  return crossing.head<2>() / crossing.z();
}

/// The corners to a fraction of a pixel. The window holds the corner of the border and no bits, which would draw it.
void refine(const cv::Mat& image, int modules, std::vector<cv::Point2f>& corners) {
  const double module_px = std::sqrt(cv::contourArea(corners)) / modules;
  const int half_px = std::clamp(static_cast<int>(std::lround(0.5 * module_px)), 2, 8);
  cv::cornerSubPix(image, corners, {half_px, half_px}, {-1, -1},
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-3});
}

}  // namespace

TargetDetection find_target_marker(const cv::Mat& grey, const TargetLook& look,
                                   const std::optional<TargetExpectation>& expected) {
  const SearchWindow window = search_window(grey, expected, 100.0);
  constexpr int min_side_px = 16;
  if (window.width < min_side_px || window.height < min_side_px) return lost_target("out of the image");
  cv::Mat image;
  grey({window.u, window.v, window.width, window.height}).convertTo(image, CV_8U);
  const auto parameters = cv::aruco::DetectorParameters::create();
  constexpr double min_perimeter_px = 32.0;  // 8 px a side: below it no bits can be read
  parameters->minMarkerPerimeterRate =
      std::min(parameters->minMarkerPerimeterRate, min_perimeter_px / std::max(image.cols, image.rows));
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  const auto dictionary = cv::aruco::getPredefinedDictionary(marker_dictionary(look.dictionary)->opencv_id);
  cv::aruco::detectMarkers(image, dictionary, corners, ids, parameters);
  std::vector<TargetDetection> seen;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] != look.marker_id) continue;
    refine(image, dictionary->markerSize + 2, corners[i]);
    TargetDetection one;
    one.px = crossing_of_diagonals(corners[i]) + window.corner();
    one.radius_px = std::sqrt(cv::contourArea(corners[i]) / 3.141592653589793);
    const double sigma_px = 0.1;  // of the centre of four refined corners
    one.cov = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    one.score = 1.0;
    seen.push_back(one);
  }
  if (seen.empty()) return lost_target("not in the image");
  if (seen.size() > 1) return lost_target(two_candidates(seen[0].px, seen[1].px));
  return seen.front();
}

}  // namespace alidade
