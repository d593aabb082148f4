#include "alidade/calibrate/calibration.h"

#include <utility>

#include "alidade/calibrate/calibration_verdict.h"

namespace alidade {
namespace {

bool asks_for_shape(const CalibrateConfig& config) {
  return config.board_shape == BoardShape::bow || config.board_shape == BoardShape::free;
}

}  // namespace

Calibration judge_calibration(const Board& board, PhotoCalibration photos, CalibrateConfig config,
                              const Progress& progress) {
  Calibration result{.photos = std::move(photos), .config = std::move(config), .study = {}, .next = {}, .verdict = {}};
  CalibrateReport& report = result.photos.report;
  if (report.status != CalibrateReport::Status::converged) {
    result.verdict = refusal_verdict(report);
    return result;
  }
  result.study = study_calibration(board, result.photos.views, result.config, report, progress);
  const bool refused_shape =
      asks_for_shape(result.config) && result.study.transfer && !result.study.transfer->transfers();
  if (refused_shape) {
    const auto transfer = result.study.transfer;
    result.config.board_shape = BoardShape::flat;
    std::vector<std::string> reasons;
    for (const ViewFit& view : report.views) reasons.push_back(view.reason);
    report = calibrate(board, result.photos.views, result.photos.size, result.config);
    for (std::size_t k = 0; k < reasons.size(); ++k) {
      if (result.photos.views[k].corners.empty()) report.views[k].reason = reasons[k];
    }
    result.study = study_calibration(board, result.photos.views, result.config, report, progress);
    result.study.transfer = transfer;
  }
  result.next = plan_next_photos(report.camera, report.noise_px, report.board_points, 1, progress);
  result.verdict = calibration_verdict(report, result.study, result.photos.views, result.config, result.next);
  return result;
}

}  // namespace alidade
