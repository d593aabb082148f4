#include "alidade/calibrate.h"

#include <algorithm>
#include <utility>

#include "alidade/board/dictionary.h"
#include "alidade/calibrate/checks/judge.h"
#include "alidade/calibrate/setup.h"
#include "alidade/calibrate/solve/port.h"
#include "alidade/calibrate/solve/weights.h"

namespace alidade {
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

/// Throws ConfigError with every fault of what was asked.
void require_sense(CalibrateConfig config, const Board& board) {
  std::vector<std::string> found = faults_of(fields_of(config));
  if (const std::string of_board = fault(board); !of_board.empty()) found.push_back(of_board);
  for (std::string& each : port_faults(config)) found.push_back(std::move(each));
  const auto num_given = static_cast<int>(config.board_points.size());
  if (config.board_shape == BoardShape::given && num_given != num_points(board)) {
    found.push_back("the board has " + std::to_string(num_points(board)) + " points, but " + std::to_string(num_given) +
                    " are given");
  }
  if (found.empty()) found = faults(config);
  std::string sentence;
  for (const std::string& each : found) sentence += (sentence.empty() ? "" : "; ") + each;
  if (!sentence.empty()) throw ConfigError(sentence);
}

/// What is wrong with a corner; empty where nothing is.
std::string corner_fault(const Corner& corner, int num_points) {
  if (corner.index < 0 || corner.index >= num_points) {
    return "the board has " + std::to_string(num_points) + " points, numbered from 0";
  }
  const bool is_finite = corner.px.allFinite() && corner.cov.allFinite();
  const bool is_covariance = is_finite && corner.cov(0, 0) > 0.0 && corner.cov.determinant() > 0.0;
  return is_covariance ? "" : "its position must be finite, and its covariance positive definite";
}

void require_sense(std::span<const BoardView> views, const ImageSize& size, const Board& board) {
  if (size.width_px < 1 || size.height_px < 1) throw ConfigError("the size of the images must be given");
  for (const BoardView& view : views) {
    for (const Corner& corner : view.corners) {
      const std::string what = corner_fault(corner, num_points(board));
      if (!what.empty()) throw ConfigError(view.photo + ": corner " + std::to_string(corner.index) + ": " + what);
    }
  }
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

}  // namespace

Calibration calibrate(const Photos& photos, const Board& board, const CalibrateConfig& config,
                      const Progress& progress) {
  CalibrateConfig used = resolved(config);
  require_sense(used, board);
  if (!photos.load && !photos.names.empty()) throw ConfigError("photos have names, but nothing that loads them");
  if (used.outliers == OutlierRule::automatic) used.outliers = OutlierRule::drop;  // found corners have covariances
  PhotoCalibration solved = calibrate_photos(photos.names, photos.load, board, used, used.board_points, progress);
  refuse_foreign_air(used, solved);
  return judge_calibration(board, std::move(solved), used, used.port.air, progress);
}

Calibration calibrate(std::vector<BoardView> views, const ImageSize& size, const Board& board,
                      const CalibrateConfig& config, const Progress& progress) {
  CalibrateConfig used = resolved(config);
  require_sense(used, board);
  require_sense(views, size, board);
  const bool have_sigma = have_covariances(views);
  if (used.outliers == OutlierRule::automatic) used.outliers = have_sigma ? OutlierRule::drop : OutlierRule::keep;
  // Corners without σ are judged as they are: the same corners, the same optimum.
  if (used.board_shape == BoardShape::automatic && !have_sigma) used.board_shape = BoardShape::flat;
  PhotoCalibration solved;
  solved.views = std::move(views);
  solved.reasons.resize(solved.views.size());
  solved.size = size;
  solved.report = calibrate(board, solved.views, size, used, used.board_points);
  refuse_foreign_air(used, solved);
  return judge_calibration(board, std::move(solved), used, used.port.air, progress);
}

}  // namespace alidade
