#include "alidade/calibrate/study.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "alidade/calibrate/checks/heldout.h"
#include "alidade/calibrate/checks/residual_structure.h"
#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr std::size_t min_photos = 6;  // two halves of three

double median_distance_m(const CalibrateReport& report) {
  std::vector<double> distances;
  for (const ViewFit& view : report.views) {
    if (view.used) distances.push_back(view.cam_from_board.translation.norm());
  }
  return median_of(std::move(distances));
}

/// What the largest of `num` normal deviates exceeds as seldom as one exceeds 3, once in 370 (Bonferroni).
double limit_of_largest(std::size_t num) {
  const double chance = std::erfc(3.0 / std::numbers::sqrt2) / static_cast<double>(std::max<std::size_t>(num, 1));
  double low = 3.0, high = 6.0;
  while (high - low > 1e-6) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::numbers::sqrt2) > chance ? low : high) = middle;
  }
  return high;
}

/// Both halves calibrated apart, on one board shape.
std::optional<Halves> compare_halves(const Board& board, std::span<const BoardView> views, ImageSize size,
                                     CalibrateConfig config, const std::vector<Eigen::Vector3d>& board_points) {
  if (views.size() < min_photos) return std::nullopt;
  config.board_shape = BoardShape::given;
  const CalibrateReport a = calibrate(board, every_other(views, 0), size, config, board_points);
  const CalibrateReport b = calibrate(board, every_other(views, 1), size, config, board_points);
  if (a.status != CalibrateReport::Status::converged || b.status != CalibrateReport::Status::converged) {
    return std::nullopt;
  }
  const auto diff = diff_cameras(a.camera, b.camera, {.cols = 30, .rows = 20});
  if (!diff) return std::nullopt;
  Halves halves{*diff, 0.0, 0.0, ""};
  std::size_t num_compared = 0;
  for (const ParameterDiff& row : halves.diff.parameters) {
    const double sigma = std::hypot(row.sigma_a, row.sigma_b), z = std::abs(row.b - row.a) / sigma;
    num_compared += sigma > 0.0 ? 1 : 0;
    if (z > halves.worst_z) {
      halves.worst_z = z;
      halves.worst_name = row.name;
    }
  }
  halves.limit = limit_of_largest(num_compared);
  return halves;
}

}  // namespace

std::vector<BoardView> used_views(std::span<const BoardView> views, const CalibrateReport& report, std::size_t most) {
  std::vector<std::size_t> taken;
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (report.views[k].used) taken.push_back(k);
  }
  const std::size_t count = std::min(most, taken.size());
  std::vector<BoardView> chosen;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t k = taken[i * taken.size() / count];
    BoardView view{views[k].photo, {}};
    for (std::size_t c = 0; c < views[k].corners.size(); ++c) {
      if (report.views[k].corners[c].used) view.corners.push_back(views[k].corners[c]);
    }
    chosen.push_back(std::move(view));
  }
  return chosen;
}

CalibrationStudy study_calibration(const Board& board, std::span<const BoardView> views, const CalibrateConfig& config,
                                   const CalibrateReport& report, std::optional<ShapeTransfer> transfer,
                                   const Progress& progress) {
  CalibrationStudy study;
  study.transfer = transfer;
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  study.cells = residual_cells(views, report, 8, 6);
  study.rings = residual_rings(views, report, 10);
  study.working_distance_m = median_distance_m(report);
  study.sigma_infinity = projection_sigma(report.camera, 60, 40, std::numeric_limits<double>::infinity());
  study.sigma_working = projection_sigma(report.camera, 60, 40, study.working_distance_m);

  constexpr std::size_t max_photos = 120;
  const std::vector<BoardView> sampled = used_views(views, report, max_photos);
  report_progress(progress, "comparing the halves", 0, 1);
  study.halves = compare_halves(board, sampled, size, config, report.board_points);
  if (sampled.size() >= min_photos) {
    const std::vector<BoardView> fewer = used_views(views, report, 60);
    study.models = heldout_models(board, fewer, size, config, report.board_points, progress);
  }
  return study;
}

}  // namespace alidade
