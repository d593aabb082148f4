#include "alidade/board_detector/kinds/marker_board.h"

#include <algorithm>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "alidade/board/dictionary.h"
#include "alidade/board_detector/kinds/marker_board_layout.h"
#include "alidade/corners/corner_fit.h"

namespace alidade {
namespace {

/// A point on the board and where it is seen.
struct Pair {
  Eigen::Vector2d place, px;
};

using Markers = std::map<int, std::array<Eigen::Vector2d, 4>>;  // number → corners in the photo

Markers read_markers(const cv::Mat& grey, const std::string& dictionary, int border_bits) {
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->markerBorderBits = border_bits;
  constexpr double min_perimeter_px = 32.0;  // 8 px a side: below it no bits can be read
  parameters->minMarkerPerimeterRate =
      std::min(parameters->minMarkerPerimeterRate, min_perimeter_px / std::max(grey.cols, grey.rows));
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, cv::aruco::getPredefinedDictionary(marker_dictionary(dictionary)->opencv_id), corners,
                           ids, parameters);
  Markers markers;
  std::map<int, int> times_seen;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    for (std::size_t k = 0; k < 4; ++k) markers[ids[i]][k] = {corners[i][k].x, corners[i][k].y};
    ++times_seen[ids[i]];
  }
  for (const auto& [id, times] : times_seen)  // which of two equal markers is the board's cannot be determined
    if (times > 1) markers.erase(id);
  return markers;
}

/// In the photo as it is or, where that shows few, with its noise smoothed away.
Markers read_markers(const cv::Mat& photo, const MarkerLayout& layout) {
  cv::Mat grey;
  photo.convertTo(grey, CV_8U);
  Markers markers = read_markers(grey, layout.dictionary, layout.border_bits);
  if (2 * markers.size() > layout.markers.size()) return markers;
  cv::GaussianBlur(grey, grey, cv::Size(), 1.0);
  Markers smoothed = read_markers(grey, layout.dictionary, layout.border_bits);
  return smoothed.size() > markers.size() ? smoothed : markers;
}

/// px_from_board near some points, by least squares; needs four pairs in general position.
std::optional<Eigen::Matrix3d> homography(const std::vector<Pair>& pairs) {
  if (pairs.size() < 4) return std::nullopt;
  std::vector<cv::Point2d> from, to;
  for (const Pair& pair : pairs) {
    from.emplace_back(pair.place.x(), pair.place.y());
    to.emplace_back(pair.px.x(), pair.px.y());
  }
  const cv::Mat found = cv::findHomography(from, to, 0);
  if (found.empty()) return std::nullopt;
  Eigen::Matrix3d px_from_board;
  for (int i = 0; i < 9; ++i) px_from_board(i / 3, i % 3) = found.at<double>(i / 3, i % 3);
  return px_from_board;
}

Eigen::Vector2d apply(const Eigen::Matrix3d& px_from_board, const Eigen::Vector2d& place) {
  return (px_from_board * place.homogeneous()).hnormalized();
}

/// The markers of the photo that lie as in a layout, up to some distortion.
Markers consistent_markers(const Markers& seen, const MarkerLayout& layout) {
  std::vector<cv::Point2d> from, to;
  std::vector<int> numbers;
  double perimeter_px = 0.0;
  for (const auto& [number, corners] : seen) {
    if (number >= static_cast<int>(layout.markers.size())) continue;
    numbers.push_back(number);
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d& place = layout.markers[static_cast<std::size_t>(number)][k];
      from.emplace_back(place.x(), place.y());
      to.emplace_back(corners[k].x(), corners[k].y());
      perimeter_px += (corners[k] - corners[(k + 1) % 4]).norm();
    }
  }
  Markers consistent;
  if (numbers.empty()) return consistent;
  constexpr double tolerance = 0.4;  // of a marker's side: a neighbour's position is more than one side away
  std::vector<unsigned char> fits;
  const double side_px = perimeter_px / static_cast<double>(4 * numbers.size());
  if (cv::findHomography(from, to, cv::RANSAC, tolerance * side_px, fits, 500).empty()) return consistent;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto all_fit =
        std::all_of(fits.begin() + static_cast<std::ptrdiff_t>(4 * i),
                    fits.begin() + static_cast<std::ptrdiff_t>(4 * i + 4), [](auto f) { return f != 0; });
    if (all_fit) consistent[numbers[i]] = seen.at(numbers[i]);
  }
  return consistent;
}

struct PlacedMarkers {
  MarkerLayout layout;
  Markers markers;
};

/// What the markers of a photo say: the layouts of the board that they may lie in, or why none.
struct Readings {
  std::vector<PlacedMarkers> placed;
  std::string reason;
};

Readings place_markers(const cv::Mat& photo, const Board& board) {
  Readings readings;
  std::size_t max_seen = 0, most = 0;
  Markers seen;
  int border_bits = 0;
  for (const MarkerLayout& layout : marker_layouts(board)) {
    if (layout.border_bits != border_bits) {
      border_bits = layout.border_bits;
      seen = read_markers(photo, layout);
      max_seen = std::max(max_seen, seen.size());
    }
    readings.placed.push_back({layout, consistent_markers(seen, layout)});
    most = std::max(most, readings.placed.back().markers.size());
  }
  const std::string what = board.kind == BoardKind::charuco ? "markers of " + board.dictionary : "tags 36h11";
  const std::size_t needed = std::min<std::size_t>(2, readings.placed.front().layout.markers.size());
  if (max_seen == 0) {
    readings.reason = "no " + what;
  } else if (2 * most < max_seen) {
    readings.reason = std::to_string(max_seen) + " " + what + ", but only " + std::to_string(most) + " lie as on the " +
                      std::to_string(board.cols) + "×" + std::to_string(board.rows) + " board";
  } else if (most < needed) {  // one does not determine the layout
    readings.reason = "only one of the " + what;
  }
  constexpr double nearly = 0.8;  // layouts that differ by a shift share most markers; what lies around them decides
  std::erase_if(readings.placed, [&](const PlacedMarkers& placed) {
    return static_cast<double>(placed.markers.size()) < nearly * static_cast<double>(most);
  });
  return readings;
}

/// Fits a corner around which nothing else is printed within the start's two vectors.
CornerFit fit_clear_corner(const cv::Mat& photo, const CornerStart& start) {
  constexpr double min_px = 3.0;  // fewer pixels do not determine seven parameters
  CornerFitConfig config;
  config.window = std::max(0.9, min_px / std::min(start.along_cols.norm(), start.along_rows.norm()));
  return fit_corner(photo, start, config);
}

/// Fits the board's points, from predictions by local homographies.
class PointFitter {
 public:
  PointFitter(const cv::Mat& photo, const Board& board, const MarkerLayout& layout)
      : photo_(photo), layout_(layout), fits_(static_cast<std::size_t>(num_points(board))) {
    for (const Eigen::Vector3d& point : points_in_board(board)) places_.push_back(point.head<2>());
  }

  void fit_near(const Markers& markers) {
    for (std::size_t i = 0; i < places_.size(); ++i) {
      std::vector<Pair> pairs;
      for (const auto& [number, px] : markers) {
        const auto& corners = layout_.markers[static_cast<std::size_t>(number)];
        const Eigen::Vector2d offset = 0.5 * (corners[0] + corners[2]) - places_[i];
        if (offset.cwiseAbs().maxCoeff() > 1.1 * layout_.pitch_m) continue;
        for (std::size_t k = 0; k < 4; ++k) pairs.push_back({corners[k], px[k]});
      }
      fit(i, pairs);
    }
  }

  /// Points without a marker beside them, from their fitted neighbours; again and again, as each may help the next.
  void grow() {
    for (bool has_grown = true; has_grown;) {
      has_grown = false;
      for (std::size_t i = 0; i < places_.size(); ++i) {
        if (fits_[i]) continue;
        const std::vector<Pair> pairs = neighbours(i);
        if (pairs.size() >= 6) has_grown = fit(i, pairs) || has_grown;
      }
    }
  }

  /// Points that do not lie among their neighbours; a lens distorts a few pitches by far less.
  void drop_misplaced() {
    std::vector<std::size_t> misplaced;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const std::vector<Pair> pairs = fits_[i] ? neighbours(i) : std::vector<Pair>{};
      const auto px_from_board = pairs.size() >= 6 ? homography(pairs) : std::nullopt;
      if (!px_from_board) continue;
      const Eigen::Vector2d expected = apply(*px_from_board, places_[i]);
      const Eigen::Vector2d next = apply(*px_from_board, places_[i] + Eigen::Vector2d(layout_.pitch_m, 0.0));
      if ((fits_[i]->px - expected).norm() > 1.0 + 0.1 * (next - expected).norm()) misplaced.push_back(i);
    }
    for (const std::size_t i : misplaced) fits_[i].reset();
  }

  [[nodiscard]] std::vector<Corner> corners() const {
    std::vector<Corner> corners;
    for (std::size_t i = 0; i < fits_.size(); ++i)
      if (fits_[i]) corners.push_back(*fits_[i]);
    return corners;
  }

 private:
  [[nodiscard]] std::vector<Pair> neighbours(std::size_t i) const {
    std::vector<Pair> pairs;
    for (std::size_t k = 0; k < places_.size(); ++k) {
      const double distance = (places_[k] - places_[i]).cwiseAbs().maxCoeff();
      if (k != i && fits_[k] && distance < 2.1 * layout_.pitch_m) pairs.push_back({places_[k], fits_[k]->px});
    }
    return pairs;
  }

  bool fit(std::size_t i, const std::vector<Pair>& pairs) {
    const auto px_from_board = homography(pairs);
    if (!px_from_board) return false;
    CornerStart start;
    start.px = apply(*px_from_board, places_[i]);
    start.along_cols = apply(*px_from_board, places_[i] + Eigen::Vector2d(layout_.clear_m, 0.0)) - start.px;
    start.along_rows = apply(*px_from_board, places_[i] + Eigen::Vector2d(0.0, layout_.clear_m)) - start.px;
    const CornerFit found = fit_clear_corner(photo_, start);
    if (!found.accepted() || (found.contrast > 0.0) != layout_.bright[i]) return false;
    fits_[i] = Corner{static_cast<int>(i), found.px, found.cov};
    return true;
  }

  const cv::Mat& photo_;
  const MarkerLayout& layout_;
  std::vector<Eigen::Vector2d> places_;
  std::vector<std::optional<Corner>> fits_;
};

}  // namespace

BoardDetection find_marker_board(const cv::Mat& photo, const Board& board) {
  const Readings readings = place_markers(photo, board);
  BoardDetection detection{.view = {}, .reason = readings.reason};
  if (!detection.found()) return detection;
  // A layout shifted by one square loses a column; the usual one is left only for better reasons than a lost corner.
  const auto half_column = static_cast<std::size_t>(board.rows / 2);
  for (const PlacedMarkers& placed : readings.placed) {
    PointFitter fitter(photo, board, placed.layout);
    fitter.fit_near(placed.markers);
    fitter.grow();
    fitter.drop_misplaced();
    std::vector<Corner> corners = fitter.corners();
    const std::size_t found = detection.view.corners.size();
    if (found == 0 || corners.size() > found + half_column) detection.view.corners = std::move(corners);
  }
  constexpr std::size_t least = 4;  // a pose needs as many
  if (detection.view.corners.size() < least) {
    detection.reason = std::to_string(readings.placed.front().markers.size()) + " markers, but only " +
                       std::to_string(detection.view.corners.size()) + " sharp corners between them";
    detection.view.corners.clear();
  }
  return detection;
}

std::size_t count_markers(const cv::Mat& photo, const std::string& dictionary) {
  cv::Mat grey;
  photo.convertTo(grey, CV_8U);
  return read_markers(grey, dictionary, 1).size();
}

BoardDetection refind_marker_board(const cv::Mat& photo, const Board& board, const BoardView& first,
                                   const Camera& camera, const Rigid3& cam_from_board) {
  BoardDetection detection;
  detection.view.photo = first.photo;
  const std::vector<MarkerLayout> layouts = marker_layouts(board);
  double clear_m = layouts.front().clear_m;
  for (const MarkerLayout& layout : layouts) clear_m = std::min(clear_m, layout.clear_m);
  const std::vector<Eigen::Vector3d> places = points_in_board(board);
  std::vector<Corner> as_usual, as_other;  // a legacy charuco board is the usual one with black and white exchanged
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto px = project(camera, cam_from_board * places[i]);
    const auto right = project(camera, cam_from_board * (places[i] + Eigen::Vector3d(clear_m, 0.0, 0.0)));
    const auto down = project(camera, cam_from_board * (places[i] + Eigen::Vector3d(0.0, clear_m, 0.0)));
    if (!px || !right || !down) continue;
    CornerStart start;
    start.px = *px;
    start.along_cols = *right - *px;
    start.along_rows = *down - *px;
    for (const Corner& corner : first.corners)
      if (corner.index == static_cast<int>(i)) start.px = corner.px;
    const CornerFit found = fit_clear_corner(photo, start);
    if (!found.accepted()) continue;
    const bool is_usual = (found.contrast > 0.0) == layouts.front().bright[i];
    (is_usual ? as_usual : as_other).push_back({static_cast<int>(i), found.px, found.cov});
  }
  detection.view.corners = as_usual.size() >= as_other.size() ? as_usual : as_other;
  if (detection.view.corners.empty()) detection.reason = "no corner where the first search saw them";
  return detection;
}

}  // namespace alidade
