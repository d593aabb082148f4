#include "alidade/calibrate/calibration.h"

#include <utility>

#include "alidade/calibrate/calibration_verdict.h"

namespace alidade {
namespace {

/// The shape to use, by what the transfer test says: one that was asked for must transfer; one that was not must fit
/// the other half's photos better by a clear tenth.
BoardShape decide_shape(BoardShape asked, const std::optional<ShapeTransfer>& transfer) {
  if (asked == BoardShape::automatic) {
    const bool bends = transfer && transfer->transfer_rms_px < 0.9 * transfer->flat_rms_px;
    return bends ? BoardShape::free : BoardShape::flat;
  }
  const bool refused = (asked == BoardShape::bow || asked == BoardShape::free) && transfer && !transfer->transfers();
  return refused ? BoardShape::flat : asked;
}

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
                              const Progress& progress) {
  Calibration result{
      .photos = std::move(photos), .config = std::move(config), .study = {}, .next = {}, .port = {}, .verdict = {}};
  CalibrateReport& report = result.photos.report;
  if (report.status != CalibrateReport::Status::converged) {
    result.verdict = refusal_verdict(report);
    return result;
  }
  constexpr std::size_t most_photos = 60;  // enough to tell a board's shape
  report_progress(progress, "testing the board's shape", 0, 1);
  const auto transfer = test_shape_transfer(board, used_views(result.photos.views, report, most_photos),
                                            result.photos.size, result.config);
  const BoardShape asked = result.config.board_shape;
  result.config.board_shape = decide_shape(asked, transfer);
  const bool solved_flat = asked == BoardShape::automatic || asked == BoardShape::flat;
  if (result.config.board_shape != asked && !(solved_flat && result.config.board_shape == BoardShape::flat)) {
    solve_again(board, result.config, result.photos);
    if (report.status != CalibrateReport::Status::converged) {
      result.verdict = refusal_verdict(report);
      return result;
    }
  }
  result.study = study_calibration(board, result.photos.views, result.config, report, transfer, progress);
  result.next = plan_next_photos(report.camera, report.noise_px, report.board_points, 1, progress);
  result.port = port_residual(report.camera);
  result.verdict = calibration_verdict(report, result.study, result.photos.views, result.config, result.next);
  return result;
}

}  // namespace alidade
