#include "alidade/calibrate/calibration.h"

#include <utility>

#include "alidade/calibrate/checks/assumed.h"
#include "alidade/calibrate/checks/better_model.h"
#include "alidade/calibrate/checks/calibration_verdict.h"
#include "alidade/calibrate/checks/judge.h"
#include "alidade/calibrate/checks/lens_change.h"

namespace alidade {
namespace {

/// Solves again with another shape, where that settles; the reasons of photos without corners stay.
bool solve_again(const CalibrateConfig& config, Calibration& result) {
  CalibrateReport again = calibrate(result.board, result.board_views, result.size, config);
  if (again.status != CalibrateReport::Status::converged) return false;
  for (std::size_t k = 0; k < result.board_views.size(); ++k) {
    if (result.board_views[k].corners.empty()) again.views[k].reason = result.views[k].reason;
  }
  static_cast<CalibrateReport&>(result) = std::move(again);
  return true;
}

Counts count_photos(const Calibration& result) {
  Counts counts;
  counts.given = result.board_views.size();
  for (std::size_t k = 0; k < counts.given; ++k) {
    if (result.views[k].used) {
      ++counts.used;
    } else {
      counts.skipped.push_back({result.board_views[k].photo, 0, result.views[k].reason});
    }
  }
  counts.dropped = counts.given - counts.used;
  return counts;
}

std::vector<std::string> used_photos(const Calibration& result) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < result.board_views.size(); ++k)
    if (result.views[k].used) names.push_back(result.board_views[k].photo);
  return names;
}

/// A change of the lens over the photos that calibrations of its parts confirm.
LensChangeStudy find_change(const Calibration& result) {
  LensChangeStudy study = lens_change(view_scores(result.board, result.config, result.board_views, result), result);
  if (study.change && !is_confirmed(*study.change, result.board, result.board_views, result.config, result))
    study.change.reset();
  return study;
}

/// The board as solved: decides its shape, and solves again where that is not the one of the first solve.
std::vector<ShapeTransfer> settle_shape(Calibration& result, const Progress& progress) {
  constexpr std::size_t max_photos = 60;  // enough to determine a board's shape
  report_progress(progress, "testing the board's shape", 0, 1);
  const BoardShape asked = result.config.board_shape;
  auto transfers = test_shape_transfer(result.board, used_views(result.board_views, result, max_photos), result.size,
                                       result.config, result.board_points);
  result.asked_shape = asked;
  result.config.board_shape = decide_shape(asked, transfers);
  const bool solved_flat = asked == BoardShape::automatic || asked == BoardShape::flat;
  if (result.config.board_shape == asked || (solved_flat && result.config.board_shape == BoardShape::flat)) {
    return transfers;
  }
  if (!solve_again(result.config, result)) {  // the answer that there is
    result.config.board_shape = asked == BoardShape::automatic ? BoardShape::flat : asked;
  }
  return transfers;
}

}  // namespace

Calibration judge_calibration(const Board& board, PhotoCalibration photos, CalibrateConfig config,
                              const std::optional<Camera>& air, const Progress& progress) {
  Calibration result;
  static_cast<CalibrateReport&>(result) = std::move(photos.report);
  result.board = board;
  result.board_views = std::move(photos.views);
  result.size = photos.size;
  result.num_unreadable = photos.num_unreadable;
  result.config = std::move(config);
  if (result.status != CalibrateReport::Status::converged) {
    advise_fitting_model(board, result.board_views, result.size, result.config, result);
    result.counts = count_photos(result);
    result.verdict = refusal_verdict(result);
    return result;
  }
  const std::vector<ShapeTransfer> transfers = settle_shape(result, progress);
  result.counts = count_photos(result);
  result.assumed = count_assumptions(board, result.config, result.board_views, air, result);
  const LensChangeStudy change = find_change(result);
  if (change.change) count_change(*change.change, result);
  result.study = study_calibration(board, result.board_views, result.config, result,
                                   max_informative(transfers, result.config.board_shape), progress);
  result.next = plan_next_photos(result.camera, shared_noise_px(result), result.board_points, 1, progress);
  result.port = port_residual(result.camera);
  result.verdict = calibration_verdict(result, result.study, result.board_views, result.config, result.next);
  heed_change(change, used_photos(result), result.verdict);
  heed_assumptions(result.assumed, result.verdict);
  return result;
}

}  // namespace alidade
