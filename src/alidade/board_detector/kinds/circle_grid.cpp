#include "alidade/board_detector/kinds/circle_grid.h"
#include "alidade/estimation/median.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <utility>

#include "alidade/board_detector/kinds/circle_grid_ellipse.h"

namespace alidade {
namespace {

/// Where a point of the board [m] is seen, near one circle.
using LocalMap = std::function<std::optional<Eigen::Vector2d>(const Eigen::Vector2d& place)>;

cv::Ptr<cv::FeatureDetector> blob_detector(const cv::Mat& grey) {
  cv::SimpleBlobDetector::Params params;
  params.minArea = 12.0F;
  params.maxArea = 0.05F * static_cast<float>(grey.total());
  params.minDistBetweenBlobs = 4.0F;
  return cv::SimpleBlobDetector::create(params);
}

/// Centres in the board's order, or none. A symmetric grid is numbered so that x runs to the right.
std::vector<Eigen::Vector2d> coarse_centres(const cv::Mat& photo, const Board& board) {
  cv::Mat grey;
  photo.convertTo(grey, CV_8U);
  const bool staggered = board.kind == BoardKind::asymmetric_circles;
  const int kind = staggered ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
  std::vector<cv::Point2f> found;
  const cv::Size size(board.cols, board.rows);
  const auto detector = blob_detector(grey);
  if (!cv::findCirclesGrid(grey, size, found, kind, detector) &&
      !cv::findCirclesGrid(grey, size, found, kind | cv::CALIB_CB_CLUSTERING, detector)) {
    return {};
  }
  std::vector<Eigen::Vector2d> centres;
  for (const cv::Point2f& centre : found) centres.emplace_back(centre.x, centre.y);
  const auto cols = static_cast<std::size_t>(board.cols);
  const Eigen::Vector2d x = centres[cols - 1] - centres[0], y = centres[centres.size() - cols] - centres[0];
  if (!staggered && x.x() * y.y() - x.y() * y.x() < 0.0) {  // a mirror image: rows from the other end
    for (std::size_t row = 0; row < static_cast<std::size_t>(board.rows / 2); ++row)
      std::swap_ranges(centres.begin() + static_cast<std::ptrdiff_t>(row * cols),
                       centres.begin() + static_cast<std::ptrdiff_t>((row + 1) * cols),
                       centres.end() - static_cast<std::ptrdiff_t>((row + 1) * cols));
  }
  const bool is_ambiguous = !staggered || board.rows % 2 == 0;  // looks the same after half a turn
  if (is_ambiguous && x.x() < 0.0) std::reverse(centres.begin(), centres.end());
  return centres;
}

/// Monomials of a cubic, constant first; the first three are linear, the first six quadratic.
Eigen::Vector<double, 10> monomials(const Eigen::Vector2d& p) {
  const double x = p.x(), y = p.y();
  return (Eigen::Vector<double, 10>() << 1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y)
      .finished();
}

/// Polynomial of the lowest residuals: cubic where the positions determine one, else quadratic, else zero.
Eigen::Matrix<double, 10, 2> fitted_polynomial(const std::vector<Eigen::Vector2d>& places,
                                               const std::vector<Eigen::Vector2d>& values) {
  Eigen::Matrix<double, 10, 2> coefficients = Eigen::Matrix<double, 10, 2>::Zero();
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(places.size()), 10), right(rows.rows(), 2);
  for (Eigen::Index r = 0; r < rows.rows(); ++r) {
    rows.row(r) = monomials(places[static_cast<std::size_t>(r)]);
    right.row(r) = values[static_cast<std::size_t>(r)];
  }
  for (const Eigen::Index terms : {10, 6}) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(rows.leftCols(terms));
    if (rows.rows() < terms + 2 || qr.rank() < terms) continue;
    coefficients.topRows(terms) = qr.solve(right);
    break;
  }
  return coefficients;
}

/// What perspective and lens do around a circle: a homography through the circles near it, and a polynomial of what
/// that leaves over.
LocalMap local_map(const std::vector<Eigen::Vector3d>& places, const std::vector<std::optional<Eigen::Vector2d>>& seen,
                   std::size_t i) {
  constexpr std::size_t enough = 25;
  std::vector<std::size_t> nearest;
  for (std::size_t k = 0; k < places.size(); ++k)
    if (seen[k]) nearest.push_back(k);
  const auto distance_m = [&](std::size_t k) { return (places[k] - places[i]).norm(); };
  std::sort(nearest.begin(), nearest.end(), [&](auto a, auto b) { return distance_m(a) < distance_m(b); });
  nearest.resize(std::min(nearest.size(), enough));
  if (nearest.size() < 6) return {};
  const double reach_m = distance_m(nearest.back());
  std::vector<cv::Point2d> from, to;
  std::vector<Eigen::Vector2d> near, left_over;
  for (const std::size_t k : nearest) {
    near.push_back((places[k] - places[i]).head<2>() / reach_m);
    left_over.push_back(*seen[k]);
    from.emplace_back(near.back().x(), near.back().y());
    to.emplace_back(seen[k]->x(), seen[k]->y());
  }
  const cv::Mat found = cv::findHomography(from, to, 0);
  if (found.empty()) return {};
  Eigen::Matrix3d H;
  for (int k = 0; k < 9; ++k) H(k / 3, k % 3) = found.at<double>(k / 3, k % 3);
  for (std::size_t k = 0; k < near.size(); ++k) left_over[k] -= (H * near[k].homogeneous()).hnormalized();
  const Eigen::Matrix<double, 10, 2> polynomial = fitted_polynomial(near, left_over);
  return [=, centre = Eigen::Vector2d(places[i].head<2>())](const Eigen::Vector2d& place) {
    const Eigen::Vector2d p = (place - centre) / reach_m;
    return std::optional<Eigen::Vector2d>((H * p.homogeneous()).hnormalized() + polynomial.transpose() * monomials(p));
  };
}

/// The image of a circle of the board: its ellipse, and the image of its centre.
struct CircleImage {
  Ellipse ellipse;
  Eigen::Vector2d centre;
};

std::optional<CircleImage> image_of_circle(const LocalMap& map, const Eigen::Vector2d& place, double radius_m) {
  constexpr int num_samples = 24;
  std::vector<Eigen::Vector2d> rim;
  for (int k = 0; k < num_samples; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / num_samples;
    const auto px = map(place + radius_m * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    if (!px) return std::nullopt;
    rim.push_back(*px);
  }
  const auto centre = map(place);
  const auto ellipse = ellipse_through(rim);
  if (!centre || !ellipse) return std::nullopt;
  return CircleImage{*ellipse, *centre};
}

/// Radius of the printed circles, from the ellipses' areas; the median over the board.
double measured_radius_m(const std::vector<std::optional<Ellipse>>& ellipses, const std::vector<LocalMap>& maps,
                         const std::vector<Eigen::Vector3d>& places, double guess_m) {
  std::vector<double> radii;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!ellipses[i] || !maps[i]) continue;
    const auto image = image_of_circle(maps[i], places[i].head<2>(), guess_m);
    if (image) radii.push_back(guess_m * std::sqrt(ellipses[i]->area() / image->ellipse.area()));
  }
  if (radii.empty()) return guess_m;
  return median_of(std::move(radii));
}

std::vector<LocalMap> local_maps(const std::vector<Eigen::Vector3d>& places,
                                 const std::vector<std::optional<Eigen::Vector2d>>& seen) {
  std::vector<LocalMap> maps;
  for (std::size_t i = 0; i < places.size(); ++i) maps.push_back(local_map(places, seen, i));
  return maps;
}

/// The fitted ellipses' centres, each moved to the image of its circle's centre; `doubt` is the relative σ of the move.
std::vector<Corner> corners_at(const std::vector<std::optional<Ellipse>>& ellipses, const std::vector<LocalMap>& maps,
                               const std::vector<Eigen::Vector3d>& places, double radius_m, double doubt) {
  std::vector<Corner> corners;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!ellipses[i] || !maps[i]) continue;
    const auto image = image_of_circle(maps[i], places[i].head<2>(), radius_m);
    if (!image) continue;
    const Eigen::Vector2d eccentricity = image->ellipse.px - image->centre;
    const double sigma_px = doubt * eccentricity.norm();
    corners.push_back({static_cast<int>(i), ellipses[i]->px - eccentricity,
                       ellipses[i]->cov + sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
  }
  return corners;
}

}  // namespace

BoardDetection find_circle_grid(const cv::Mat& photo, const Board& board) {
  const std::vector<Eigen::Vector2d> centres = coarse_centres(photo, board);
  const std::vector<Eigen::Vector3d> places = points_in_board(board);
  if (centres.size() != places.size()) {
    return not_found("no grid of " + std::to_string(board.cols) + "×" + std::to_string(board.rows) + " circles");
  }
  std::vector<std::optional<Eigen::Vector2d>> seen(centres.begin(), centres.end());
  const double guess_m = circle_radius_m(board);
  std::vector<LocalMap> maps = local_maps(places, seen);
  std::vector<std::optional<Ellipse>> ellipses(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto image = maps[i] ? image_of_circle(maps[i], places[i].head<2>(), guess_m) : std::nullopt;
    if (!image) continue;
    Ellipse start = image->ellipse;
    start.px = centres[i];
    ellipses[i] = fit_ellipse(photo, start);
    seen[i] = ellipses[i] ? std::optional(ellipses[i]->px) : std::nullopt;
  }
  maps = local_maps(places, seen);
  const double radius_m = board.marker_m > 0.0 ? guess_m : measured_radius_m(ellipses, maps, places, guess_m);
  BoardDetection detection;
  constexpr double doubt = 0.07;  // of the lens curvature by neighbours: scatter over boards seen by a 64° lens
  detection.view.corners = corners_at(ellipses, maps, places, radius_m, doubt);
  if (2 * detection.view.corners.size() < places.size()) {
    return not_found("only " + std::to_string(detection.view.corners.size()) + " of " + std::to_string(places.size()) +
                     " circles are sharp discs");
  }
  return detection;
}

BoardDetection refind_circle_grid(const cv::Mat& photo, const Board& board, const BoardView& first,
                                  const Camera& camera, const Rigid3& cam_from_board) {
  const std::vector<Eigen::Vector3d> places = points_in_board(board);
  std::vector<LocalMap> maps(places.size());
  std::vector<std::optional<Ellipse>> ellipses(places.size());
  const double guess_m = circle_radius_m(board);
  for (const Corner& corner : first.corners) {
    const auto i = static_cast<std::size_t>(corner.index);
    maps[i] = [&](const Eigen::Vector2d& place) {
      return project(camera, cam_from_board * Eigen::Vector3d(place.x(), place.y(), 0.0));
    };
    const auto image = image_of_circle(maps[i], places[i].head<2>(), guess_m);
    if (!image) continue;
    Ellipse start = image->ellipse;
    start.px += corner.px - image->centre;
    ellipses[i] = fit_ellipse(photo, start);
  }
  const double radius_m = board.marker_m > 0.0 ? guess_m : measured_radius_m(ellipses, maps, places, guess_m);
  BoardDetection detection;
  detection.view.photo = first.photo;
  detection.view.corners = corners_at(ellipses, maps, places, radius_m, 0.0);
  if (detection.view.corners.empty()) detection.reason = "no circle where the first search saw them";
  return detection;
}

}  // namespace alidade
