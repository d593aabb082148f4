#include "alidade/calibrate.h"

#include <algorithm>
#include <utility>

#include "alidade/board/dictionary.h"
#include "alidade/calibrate/judge.h"
#include "alidade/calibrate/port.h"
#include "alidade/calibrate/setup.h"
#include "alidade/calibrate/weights.h"

namespace alidade {
namespace {

/// Skew is fixed unless it is freed, and what is known of a port stands beside what is fixed.
CalibrateConfig resolved(CalibrateConfig config) {
  if (std::find(config.fixed.begin(), config.fixed.end(), "skew") == config.fixed.end()) {
    config.fixed.insert(config.fixed.begin(), "skew");
  }
  if (config.model == FlatPort::name) config = with_port(std::move(config), config.port);
  for (const std::string& name : config.free) std::erase(config.fixed, name);
  return config;
}

/// Throws ConfigError with every fault of what was asked.
void require_sense(const CalibrateConfig& config, const Board& board) {
  std::vector<std::string> found;
  if (const std::string of_board = fault(board); !of_board.empty()) found.push_back(of_board);
  const bool is_port = config.model == FlatPort::name;
  if (!is_port && (config.port.air || config.port.glass_m))
    found.push_back("--air and --glass are of --model flat_port");
  if (is_port && !config.port.glass_m) {
    found.push_back("--model flat_port: give the port's thickness in metres, --glass 0.01");
  }
  const Camera* air = config.port.air ? &*config.port.air : nullptr;
  if (air && !std::holds_alternative<Calibrated<Pinhole>>(air->lens) &&
      !std::holds_alternative<Calibrated<Brown>>(air->lens)) {
    found.push_back("a lens behind a port must be pinhole or brown, not " + std::string(model_name(air->lens)));
  }
  if (config.board_shape == BoardShape::given && config.board_points.size() != points_in_board(board).size()) {
    found.push_back("the board has " + std::to_string(num_points(board)) + " points, but " +
                    std::to_string(config.board_points.size()) + " are given");
  }
  CalibrateConfig values = config;
  for (const std::string& each : faults_of(fields_of(values))) found.push_back(each);
  if (found.empty()) found = faults(config);
  std::string sentence;
  for (const std::string& each : found) sentence += (sentence.empty() ? "" : "; ") + each;
  if (!sentence.empty()) throw ConfigError(sentence);
}

}  // namespace

Calibration calibrate(const Photos& photos, const Board& board, const CalibrateConfig& config,
                      const Progress& progress) {
  CalibrateConfig used = resolved(config);
  require_sense(used, board);
  if (used.outliers == OutlierRule::automatic)
    used.outliers = OutlierRule::drop;  // found corners have their covariance
  PhotoCalibration solved = calibrate_photos(photos.names, photos.load, board, used, used.board_points, progress);
  return judge_calibration(board, std::move(solved), used, used.port.air, progress);
}

Calibration calibrate(std::vector<BoardView> views, const ImageSize& size, const Board& board,
                      const CalibrateConfig& config, const Progress& progress) {
  CalibrateConfig used = resolved(config);
  require_sense(used, board);
  const bool have_sigma = have_covariances(views);
  if (used.outliers == OutlierRule::automatic) used.outliers = have_sigma ? OutlierRule::drop : OutlierRule::keep;
  // Corners without σ are judged as they are: the same corners, the same optimum.
  if (used.board_shape == BoardShape::automatic && !have_sigma) used.board_shape = BoardShape::flat;
  PhotoCalibration solved;
  solved.views = std::move(views);
  solved.reasons.resize(solved.views.size());
  solved.size = size;
  solved.report = calibrate(board, solved.views, size, used, used.board_points);
  return judge_calibration(board, std::move(solved), used, used.port.air, progress);
}

}  // namespace alidade
