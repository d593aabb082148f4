#include "alidade/calibrate.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "alidade/board/board_fields.h"
#include "alidade/board/dictionary.h"
#include "alidade/calibrate/checks/judge.h"
#include "alidade/calibrate/setup.h"
#include "alidade/calibrate/solve/port.h"
#include "alidade/calibrate/solve/weights.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// How many corners lie outside the images, and how many there are.
std::pair<std::size_t, std::size_t> count_outside(std::span<const BoardView> views, const ImageSize& size) {
  std::size_t num_outside = 0, num = 0;
  for (const BoardView& view : views) {
    num += view.corners.size();
    num_outside += static_cast<std::size_t>(std::ranges::count_if(view.corners, [&](const Corner& corner) {
      return !(corner.px.minCoeff() > -1.0 && corner.px.x() < size.width_px && corner.px.y() < size.height_px);
    }));
  }
  return {num_outside, num};
}

std::string outside_text(std::size_t num_outside, std::size_t num, const ImageSize& size) {
  return fmt::format("{} of {} corners lie outside images of {}x{} px", num_outside, num, size.width_px,
                     size.height_px);
}

/// The larger side of what holds all corners.
double extent_px(std::span<const BoardView> views) {
  Eigen::AlignedBox2d box;
  for (const BoardView& view : views)
    for (const Corner& corner : view.corners) box.extend(corner.px);
  return box.isEmpty() ? 0.0 : box.sizes().maxCoeff();
}

}  // namespace

std::string outside_fault(std::span<const BoardView> views, const ImageSize& size) {
  constexpr double least_px = 5.0;  // no board is seen in so few
  const double extent = extent_px(views);
  if (extent > 0.0 && extent < least_px)
    return fmt::format("all corners lie within {:.2g} px, as in normalised coordinates: give them in pixels", extent);
  const auto [num_outside, num] = count_outside(views, size);
  return 10 * num_outside > num ? outside_text(num_outside, num, size) + ": check the size" : "";
}

namespace {

bool may_stand_behind_a_port(const Lens& lens) {
  return std::holds_alternative<Calibrated<Pinhole>>(lens) || std::holds_alternative<Calibrated<Brown>>(lens);
}

std::vector<std::string> port_faults(const CalibrateConfig& config) {
  const PortKnowledge& port = config.port;
  if (config.model != FlatPort::name) {
    if (port.air || port.glass_m) return {"--air and --glass are of --model flat_port"};
    return {};
  }
  if (!port.glass_m) return {"--model flat_port: give the port's thickness in metres, --glass 0.01"};
  if (port.air && !may_stand_behind_a_port(port.air->lens)) {
    return {"a lens behind a port must be pinhole or brown, not " + std::string(model_name(port.air->lens))};
  }
  return {};
}

double extent_of(const std::vector<Eigen::Vector3d>& points) {
  double far_m = 0.0;
  for (const Eigen::Vector3d& point : points) far_m = std::max(far_m, (point - points.front()).norm());
  return far_m;
}

/// What is wrong with given points of a board, whatever its shape; empty where nothing is.
std::string points_fault(const std::vector<Eigen::Vector3d>& points, const Board& board) {
  constexpr double max_m = 1e6;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) return fmt::format("board_points: point {} is not finite", i);
    const double far_m = points[i].cwiseAbs().maxCoeff();
    if (far_m > max_m) return fmt::format("board_points: point {} is {:.3g} m away; they are in metres", i, far_m);
    spread += (points[i] - points.front()) * (points[i] - points.front()).transpose();
  }
  const Eigen::Vector3d squares = symmetric_eigen3(spread).values;  // ascending
  if (!(squares[1] > 1e-8 * squares[2])) return "board_points: they all lie on one line, or in one place";
  constexpr double other_unit = 9.0;  // no bow, and no tape that slips, moves the last point so far
  const double given_m = extent_of(points), nominal_m = extent_of(points_in_board(board));
  if (given_m < other_unit * nominal_m && nominal_m < other_unit * given_m) return {};
  return fmt::format("board_points: they reach {:.3g} m far, by the board's pitch {:.3g} m: they are in metres",
                     given_m, nominal_m);
}

/// Throws ConfigError with every fault of what was asked.
void require_sense(CalibrateConfig config, const Board& board) {
  std::vector<std::string> found = faults_of(fields_of(config));
  if (const std::string of_board = fault(board); !of_board.empty()) found.push_back(of_board);
  for (std::string& each : port_faults(config)) found.push_back(std::move(each));
  const auto num_given = static_cast<int>(config.board_points.size());
  if (config.board_shape == BoardShape::given && num_given != num_points(board)) {
    found.push_back("the board has " + std::to_string(num_points(board)) + " points, but " + std::to_string(num_given) +
                    " are given");
  } else if (config.board_shape == BoardShape::given) {
    if (std::string of_points = points_fault(config.board_points, board); !of_points.empty())
      found.push_back(std::move(of_points));
  }
  if (config.board_shape != BoardShape::given && num_given > 0)
    found.emplace_back("board_points are of BoardShape::given, and another shape is asked for");
  if (found.empty()) found = faults(config);
  std::string sentence;
  for (const std::string& each : found) sentence += (sentence.empty() ? "" : "; ") + each;
  if (!sentence.empty()) throw ConfigError(sentence);
}

void require_sense(std::span<const BoardView> views, const ImageSize& size, const Board& board) {
  if (size.width_px < 1 || size.height_px < 1) throw ConfigError("the size of the images must be given");
  for (const BoardView& view : views) {
    if (const std::string what = corners_fault(view, num_points(board)); !what.empty())
      throw ConfigError(view.photo + ": " + what);
    for (const Corner& corner : view.corners)
      if (!corner.cov.allFinite() || !(corner.cov(0, 0) > 0.0) || !(corner.cov.determinant() > 0.0))
        throw ConfigError(
            fmt::format("{}: corner {}: its covariance must be positive definite", view.photo, corner.index));
  }
}

/// A few corners outside the images may be wrong ones.
Check inside_check(std::span<const BoardView> views, const ImageSize& size) {
  if (const std::string fault = outside_fault(views, size); !fault.empty()) throw ConfigError(fault);
  const auto [num_outside, num] = count_outside(views, size);
  if (num_outside == 0)
    return {.name = "corners inside", .text = "all corners are inside the images", .unit = "corners"};
  return {.name = "corners inside",
          .state = State::care,
          .text = outside_text(num_outside, num, size),
          .value = static_cast<double>(num_outside),
          .unit = "corners"};
}

/// Squares that no printed board has: of another unit. The lens is right with them, the poses are not.
Check square_check(const Board& board) {
  Check check{.name = "square", .text = "the squares are of a size that is printed", .value = board.square_m};
  check.unit = "m";
  if (board.square_m >= min_square_m && board.square_m <= max_square_m) return check;
  check.state = State::care;
  check.text = fmt::format("the board's squares are {:.3g} m wide: square_m is in metres", board.square_m);
  return check;
}

/// A fixed lens must be of images of that size.
void refuse_foreign_air(const CalibrateConfig& config, PhotoCalibration& solved) {
  const std::optional<Camera>& air = config.port.air;
  const ImageSize& size = solved.size;
  if (!air || size.width_px == 0 || (air->width_px == size.width_px && air->height_px == size.height_px)) return;
  solved.report.status = CalibrateReport::Status::degenerate;
  solved.report.reason = "the lens in air is of another image size than the photos";
  solved.report.to_add = "give the camera file of photos of the same size";
}

Calibration judged(PhotoCalibration solved, const Board& board, const CalibrateConfig& config,
                   const Progress& progress) {
  refuse_foreign_air(config, solved);
  Calibration result = judge_calibration(board, std::move(solved), config, config.port.air, progress);
  const Check square = square_check(board);
  if (square.state != State::good) heed(square, "give square_m in metres: 25 mm are 0.025", result.verdict);
  return result;
}

}  // namespace

Calibration calibrate(const Photos& photos, const Board& board, const CalibrateConfig& config,
                      const Progress& progress) {
  CalibrateConfig used = resolved(config);
  require_sense(used, board);
  if (!photos.load && !photos.names.empty()) throw ConfigError("photos have names, but nothing that loads them");
  if (used.outliers == OutlierRule::automatic) used.outliers = OutlierRule::drop;  // found corners have covariances
  PhotoCalibration solved = calibrate_photos(photos.names, photos.load, board, used, used.board_points, progress);
  return judged(std::move(solved), board, used, progress);
}

Calibration calibrate(std::vector<BoardView> views, const ImageSize& size, const Board& board,
                      const CalibrateConfig& config, const Progress& progress) {
  CalibrateConfig used = resolved(config);
  require_sense(used, board);
  require_sense(views, size, board);
  const Check inside = inside_check(views, size);
  const bool have_sigma = have_covariances(views);
  if (used.outliers == OutlierRule::automatic) used.outliers = have_sigma ? OutlierRule::drop : OutlierRule::keep;
  // Corners without σ are judged as they are: the same corners, the same optimum.
  if (used.board_shape == BoardShape::automatic && !have_sigma) used.board_shape = BoardShape::flat;
  PhotoCalibration solved;
  solved.views = std::move(views);
  solved.reasons.resize(solved.views.size());
  solved.size = size;
  solved.report = calibrate(board, solved.views, size, used, used.board_points);
  Calibration result = judged(std::move(solved), board, used, progress);
  if (inside.state != State::good) heed(inside, "check the size of the images", result.verdict);
  return result;
}

}  // namespace alidade
