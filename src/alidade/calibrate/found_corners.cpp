#include "alidade/calibrate/found_corners.h"

#include <algorithm>
#include <cmath>

#include "alidade/calibrate.h"
#include "alidade/calibrate/checks/corner_numbering.h"
#include "alidade/estimation/median.h"

namespace alidade {
namespace {

/// Whether a view's corners are the calibration's outliers, all of them: most of them fit no board.
bool is_misfit(const ViewFit& fit) { return !fit.used && is_misfit_reason(fit.reason); }

/// What is found, less the outliers, with the covariance to be stated.
void state_corners(bool drop, FoundCorners& found) {
  Calibration& all = found.calibration;
  found.size = all.size;
  found.has_excess = all.status == CalibrateReport::Status::converged;
  found.excess_px = found.has_excess ? all.excess_px : 0.0;
  const Eigen::Matrix2d excess = found.excess_px * found.excess_px * Eigen::Matrix2d::Identity();
  std::vector<double> sigmas;
  for (std::size_t k = 0; k < all.board_views.size(); ++k) {
    const ViewFit& fit = all.views[k];
    BoardView view{all.board_views[k].photo, {}};
    for (std::size_t i = 0; i < all.board_views[k].corners.size(); ++i) {
      Corner& corner = all.board_views[k].corners[i];
      corner.cov += excess;
      if (drop && found.has_excess && (is_misfit(fit) || (fit.used && !fit.corners[i].used))) {
        ++found.num_rejected;
        if (fit.used) found.rejected.push_back(view.photo + ": corner " + std::to_string(corner.index));
        continue;
      }
      sigmas.push_back(std::sqrt(0.5 * corner.cov.trace()));
      view.corners.push_back(corner);
    }
    found.num_corners += view.corners.size();
    found.num_photos += view.corners.empty() ? 0 : 1;
    found.board_views.push_back(std::move(view));
  }
  found.sigma_px = median_of(std::move(sigmas));
}

Verdict corners_verdict(const FoundCorners& found) {
  const Calibration& calibration = found.calibration;
  Verdict verdict;
  if (found.num_corners == 0) {
    const bool is_given = calibration.to_add.starts_with("use ");
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    verdict.sentence = is_given ? calibration.reason : "no photo shows the board";
    verdict.to_add =
        is_given ? calibration.to_add : "check --board and --board-kind, and that the whole board is in the photos";
    return verdict;
  }
  const std::string counted = std::to_string(found.num_corners) + " corners in " + std::to_string(found.num_photos) +
                              " photo" + (found.num_photos == 1 ? "" : "s") + ", σ " + text_of(found.sigma_px) + " px";
  if (!found.has_excess) {
    verdict.state = State::care;
    verdict.sentence = counted + ", each corner's own alone: " + calibration.reason;
    verdict.to_add = calibration.to_add;
    return verdict;
  }
  const bool lens_fits = calibration.verdict.state != State::bad;
  verdict.state = lens_fits ? State::good : State::care;
  verdict.sentence = counted + ", " + text_of(found.excess_px) + " px of it found by calibration in the residuals";
  if (!lens_fits) {
    verdict.sentence += ", where that calibration is not to be trusted";
    verdict.to_add = calibration.verdict.to_add;
  }
  return verdict;
}

/// Photos with too few corners for a camera have corners nevertheless.
Counts count_photos(const FoundCorners& found) {
  Counts counts = found.calibration.counts;
  counts.used = found.num_photos;
  counts.dropped = counts.given - counts.used;
  std::erase_if(counts.skipped, [&](const SkippedInput& skipped) {
    return std::any_of(found.board_views.begin(), found.board_views.end(),
                       [&](const BoardView& view) { return view.photo == skipped.file && !view.corners.empty(); });
  });
  return counts;
}

}  // namespace

FoundCorners find_corners(const Photos& photos, const Board& board, const CalibrateConfig& config,
                          const Progress& progress) {
  FoundCorners found;
  CalibrateConfig used = config;
  used.outliers = OutlierRule::drop;  // the calibration is there for the noise
  found.calibration = calibrate(photos, board, used, progress);
  state_corners(config.outliers != OutlierRule::keep, found);
  found.counts = count_photos(found);
  found.verdict = corners_verdict(found);
  return found;
}

}  // namespace alidade
