#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "alidade/board/board_pose.h"
#include "alidade/calibrate/checks/corner_numbering.h"
#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr const char* misfit_words = "do not fit the other photos";

struct Flip {
  bool u = false, v = false;
  const char* words = "";
};
constexpr std::array<Flip, 3> flips{Flip{true, false, "mirrored left to right"},
                                    Flip{false, true, "mirrored upside down"}, Flip{true, true, "rotated by 180°"}};

/// The view as the image was before. What finds boards numbers them as seen from the front, in a mirrored image too:
/// there the columns count the other way.
BoardView undone(const BoardView& view, const Flip& flip, const Board& board, const Camera& camera) {
  BoardView before = view;
  for (Corner& corner : before.corners) {
    if (flip.u) corner.px.x() = camera.width_px - 1.0 - corner.px.x();
    if (flip.v) corner.px.y() = camera.height_px - 1.0 - corner.px.y();
    if (flip.u == flip.v) continue;
    const int row = corner.index / board.cols, col = corner.index % board.cols;
    corner.index = row * board.cols + board.cols - 1 - col;
  }
  return before;
}

double rms_in_best_pose(const Camera& camera, const BoardView& view, std::span<const Eigen::Vector3d> points) {
  const auto fit = fit_board_pose(camera, view, points, 1.0);
  return fit && fit->dof > 0 ? std::sqrt(fit->chi2 / fit->dof) : std::numeric_limits<double>::infinity();
}

/// How the image was flipped: as it was before, the corners fit the lens far better, and as well as others do.
const Flip* flip_of(const Board& board, const BoardView& view, const CalibrateReport& report, double noise_px) {
  constexpr double as_good = 2.0, far_better = 0.4;
  const double as_is_px = rms_in_best_pose(report.camera, view, report.board_points);
  const bool is_grid = board.kind == BoardKind::chessboard || board.kind == BoardKind::circles;
  const auto* const found = std::ranges::find_if(flips, [&](const Flip& flip) {
    if (flip.u != flip.v && !is_grid) return false;  // markers are not found in a mirrored image
    const double px = rms_in_best_pose(report.camera, undone(view, flip, board, report.camera), report.board_points);
    return px < as_good * noise_px && px < far_better * as_is_px;
  });
  return found == flips.end() ? nullptr : found;
}

/// Of each view in use, else zero.
std::vector<double> used_rms_px(std::span<const BoardView> views, const CalibrateReport& report) {
  std::vector<double> rms_px(views.size(), 0.0);
  for (std::size_t k = 0; k < views.size(); ++k)
    if (report.views[k].used) rms_px[k] = rms_in_best_pose(report.camera, views[k], report.board_points);
  return rms_px;
}

double median_of_used(std::vector<double> rms_px) {
  std::erase(rms_px, 0.0);
  return rms_px.empty() ? 0.0 : median_of(std::move(rms_px));
}

std::string flip_words(const Flip& flip) {
  return std::string("; ") + flip.words + " they do: take the photo as the camera stored it";
}

}  // namespace

bool is_misfit_reason(const std::string& reason) { return reason.find(misfit_words) != std::string::npos; }

void reject_flipped_photos(const Board& board, ImageSize size, const CalibrateConfig& config,
                           std::vector<BoardView>& views, CalibrateReport& report) {
  constexpr double suspicious = 1.5;
  constexpr int most = 3;
  if (!is_central(report.camera.lens) || config.outliers == OutlierRule::keep) return;
  for (int round = 0; round < most; ++round) {
    const std::vector<double> rms_px = used_rms_px(views, report);
    const auto worst = static_cast<std::size_t>(std::ranges::max_element(rms_px) - rms_px.begin());
    if (!(rms_px[worst] > suspicious * median_of_used(rms_px))) return;
    std::vector<BoardView> others = views;
    others[worst].corners.clear();
    CalibrateReport without = calibrate(board, others, size, config, report.board_points);
    if (without.status != CalibrateReport::Status::converged) return;
    const Flip* const flip = flip_of(board, views[worst], without, median_of_used(used_rms_px(others, without)));
    if (flip == nullptr) return;
    for (std::size_t k = 0; k < views.size(); ++k)
      if (others[k].corners.empty()) without.views[k].reason = report.views[k].reason;
    without.views[worst].reason = std::string("its corners ") + misfit_words + flip_words(*flip);
    report = std::move(without);
    views = std::move(others);
  }
}

void name_flipped_photos(const Board& board, std::span<const BoardView> views, CalibrateReport& report) {
  if (!is_central(report.camera.lens)) return;
  const double noise_px = median_of_used(used_rms_px(views, report));
  for (std::size_t k = 0; k < views.size(); ++k) {
    ViewFit& fit = report.views[k];
    if (fit.used || !fit.reason.ends_with(misfit_words)) continue;
    if (const Flip* const flip = flip_of(board, views[k], report, noise_px)) fit.reason += flip_words(*flip);
  }
}

}  // namespace alidade
