#include "alidade/calibrate/calibration.h"

#include <utility>

#include "alidade/calibrate/better_model.h"
#include "alidade/calibrate/calibration_verdict.h"

namespace alidade {
namespace {

/// Solves again with another shape; the reasons of photos without corners stay.
void solve_again(const Board& board, const CalibrateConfig& config, PhotoCalibration& photos) {
  CalibrateReport again = calibrate(board, photos.views, photos.size, config);
  for (std::size_t k = 0; k < photos.views.size(); ++k) {
    if (photos.views[k].corners.empty()) again.views[k].reason = photos.report.views[k].reason;
  }
  photos.report = std::move(again);
}

}  // namespace

Calibration judge_calibration(const Board& board, PhotoCalibration photos, CalibrateConfig config,
                              const std::optional<Camera>& air, const Progress& progress) {
  Calibration result;
  result.photos = std::move(photos);
  result.config = std::move(config);
  CalibrateReport& report = result.photos.report;
  if (report.status != CalibrateReport::Status::converged) {
    advise_fitting_model(board, result.photos.views, result.photos.size, result.config, report);
    result.verdict = refusal_verdict(report);
    return result;
  }
  constexpr std::size_t most_photos = 60;  // enough to tell a board's shape
  report_progress(progress, "testing the board's shape", 0, 1);
  const BoardShape asked = result.config.board_shape;
  const auto transfers = test_shape_transfer(board, used_views(result.photos.views, report, most_photos),
                                             result.photos.size, result.config, report.board_points);
  result.asked_shape = asked;
  result.config.board_shape = decide_shape(asked, transfers);
  const bool solved_flat = asked == BoardShape::automatic || asked == BoardShape::flat;
  if (result.config.board_shape != asked && !(solved_flat && result.config.board_shape == BoardShape::flat)) {
    PhotoCalibration other = result.photos;
    solve_again(board, result.config, other);
    if (other.report.status == CalibrateReport::Status::converged) {
      result.photos = std::move(other);
    } else {  // the answer that there is
      result.config.board_shape = asked == BoardShape::automatic ? BoardShape::flat : asked;
    }
  }
  result.assumed = count_assumptions(board, result.config, result.photos.views, air, report);
  result.study = study_calibration(board, result.photos.views, result.config, report,
                                   most_telling(transfers, result.config.board_shape), progress);
  result.next = plan_next_photos(report.camera, shared_noise_px(report), report.board_points, 1, progress);
  result.port = port_residual(report.camera);
  result.verdict = calibration_verdict(report, result.study, result.photos.views, result.config, result.next);
  heed_assumptions(result.assumed, result.verdict);
  return result;
}

}  // namespace alidade
