#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "alidade/board/board_pose.h"
#include "alidade/calibrate/changes/two_lenses.h"
#include "alidade/calibrate/checks/corner_numbering.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/calibrate/study.h"
#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr const char* misfit_words = "do not fit the other photos";
constexpr const char* take_as_stored = "take all photos as the camera stored them";

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

/// Markers are not found in a mirrored image.
bool can_be_mirrored(const Board& board) {
  return board.kind == BoardKind::chessboard || board.kind == BoardKind::circles;
}

/// How the image was flipped: as it was before, the corners fit the lens far better, and as well as others do.
const Flip* flip_of(const Board& board, const BoardView& view, const CalibrateReport& report, double noise_px) {
  constexpr double as_good = 2.0, far_better = 0.4;
  const double as_is_px = rms_in_best_pose(report.camera, view, report.board_points);
  const auto* const found = std::ranges::find_if(flips, [&](const Flip& flip) {
    if (flip.u != flip.v && !can_be_mirrored(board)) return false;
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

std::vector<BoardView> undone(std::span<const BoardView> views, const std::vector<bool>& is_flipped, const Flip& flip,
                              const Board& board, const Camera& camera) {
  std::vector<BoardView> before(views.begin(), views.end());
  for (std::size_t k = 0; k < views.size(); ++k)
    if (is_flipped[k]) before[k] = undone(views[k], flip, board, camera);
  return before;
}

/// Photos that were flipped, and the lens by all as they were before.
struct FlippedSet {
  const Flip* flip;
  std::vector<bool> is_flipped;
  CalibrateReport report;
};

/// The set that settles, each view flipped or not as it fits better; none where it does not, or where it is not the
/// smaller part.
std::optional<FlippedSet> settled(const Board& board, std::span<const BoardView> used, std::vector<bool> is_flipped,
                                  const Flip& flip, const CalibrateConfig& config, const CalibrateReport& report) {
  constexpr int rounds = 8;
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  for (int round = 0; round < rounds; ++round) {
    if (2 * std::ranges::count(is_flipped, true) > std::ssize(is_flipped)) is_flipped.flip();
    FlippedSet set{
        &flip, is_flipped,
        calibrate(board, undone(used, is_flipped, flip, board, report.camera), size, config, report.board_points)};
    if (set.report.status != CalibrateReport::Status::converged) return std::nullopt;
    for (std::size_t k = 0; k < used.size(); ++k)
      is_flipped[k] =
          rms_in_best_pose(set.report.camera, undone(used[k], flip, board, report.camera), report.board_points) <
          rms_in_best_pose(set.report.camera, used[k], report.board_points);
    if (is_flipped == set.is_flipped) return set;
  }
  return std::nullopt;
}

std::string flip_words(const Flip& flip) {
  return std::string("; ") + flip.words + " they do: take the photo as the camera stored it";
}

/// Directions of the lens in which such photos may lie apart: the centre is on the other side.
std::vector<Eigen::VectorXd> across(const Flip& flip, Eigen::Index num_params) {
  const Eigen::VectorXd cx = Eigen::VectorXd::Unit(num_params, 2), cy = Eigen::VectorXd::Unit(num_params, 3);
  if (flip.u && flip.v) return {cx, cy, cx + cy, cx - cy};
  return {flip.u ? cx : cy};
}

/// Otherwise numbers tell which are mirrored.
bool all_from_the_front(const CalibrateReport& report) {
  return std::ranges::none_of(report.views, [](const ViewFit& view) {
    return view.used && view.cam_from_board.inverse().translation.z() > 0.0;
  });
}

/// Several photos that were flipped alike: where photos disagree, and no more than by chance once these are as they
/// were, or by `share_left` of what they did: a centre that jumps across the image's leaves some of it.
std::optional<FlippedSet> flipped_set(const Board& board, std::span<const BoardView> used,
                                      std::span<const ViewScore> scores, CalibrateConfig config,
                                      const CalibrateReport& report, double share_left) {
  constexpr double disagree = 3.0, chance = 0.5;
  constexpr std::size_t fewest = 8;
  const double beyond = report.clusters.design_effect - 1.0;
  if (used.size() < fewest || scores.size() != used.size() || beyond < disagree) return std::nullopt;
  config.board_shape = BoardShape::given;
  const bool may_be_mirrored = can_be_mirrored(board) && all_from_the_front(report);
  std::optional<FlippedSet> best;
  for (const Flip& flip : flips) {
    if (flip.u != flip.v && !may_be_mirrored) continue;
    for (const Eigen::VectorXd& direction : across(flip, params(report.camera.lens).size())) {
      auto set = settled(board, used, divided_along(scores, direction), flip, config, report);
      if (set && (!best || set->report.noise_px < best->report.noise_px)) best = std::move(set);
    }
  }
  if (!best || best->report.clusters.design_effect - 1.0 > std::max(chance, share_left * beyond)) return std::nullopt;
  return best;
}

/// The solve without some views, whose corners `others` lack: these are named, the reasons of the rest stay.
void take(CalibrateReport without, std::vector<BoardView> others, const Flip& flip, std::vector<BoardView>& views,
          CalibrateReport& report) {
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!others[k].corners.empty()) continue;
    without.views[k].reason = views[k].corners.empty() ? report.views[k].reason
                                                       : std::string("its corners ") + misfit_words + flip_words(flip);
  }
  report = std::move(without);
  views = std::move(others);
}

void reject_flipped_set(const Board& board, const CalibrateConfig& config, std::vector<BoardView>& views,
                        CalibrateReport& report) {
  const std::vector<BoardView> used = used_views(views, report, views.size());
  const auto set = flipped_set(board, used, view_scores(board, config, views, report), config, report, 0.0);
  if (!set) return;
  std::vector<BoardView> others = views;
  for (std::size_t k = 0, at = 0; k < views.size(); ++k)
    if (report.views[k].used && set->is_flipped[at++]) others[k].corners.clear();
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  CalibrateReport without = calibrate(board, others, size, config, report.board_points);
  if (without.status == CalibrateReport::Status::converged)
    take(std::move(without), std::move(others), *set->flip, views, report);
}

}  // namespace

bool is_misfit_reason(const std::string& reason) { return reason.find(misfit_words) != std::string::npos; }

void reject_flipped_photos(const Board& board, ImageSize size, const CalibrateConfig& config,
                           std::vector<BoardView>& views, CalibrateReport& report) {
  if (!is_central(report.camera.lens) || config.outliers == OutlierRule::keep) return;
  reject_flipped_set(board, config, views, report);
  constexpr double suspicious = 1.5;
  constexpr int most = 3;
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
    take(std::move(without), std::move(others), *flip, views, report);
  }
}

std::optional<Check> kept_flips(const Board& board, const CalibrateConfig& config, std::span<const BoardView> views,
                                const CalibrateReport& report) {
  if (!is_central(report.camera.lens) || config.outliers != OutlierRule::keep) return std::nullopt;
  const std::vector<BoardView> used = used_views(views, report, views.size());
  // Their noise is not known: photos that still disagree a little are of no trusted lens either way.
  const auto set = flipped_set(board, used, view_scores(board, config, views, report), config, report, 0.1);
  if (!set) return std::nullopt;
  constexpr int named = 4;
  int num = 0;
  std::string names;
  for (std::size_t k = 0; k < used.size(); ++k)
    if (set->is_flipped[k] && ++num <= named) names += (num == 1 ? "" : ", ") + used[k].photo;
  Check check{.name = "one orientation", .state = State::bad, .unit = "1", .figure = "photos"};
  check.value = std::sqrt(report.clusters.design_effect / std::max(1.0, set->report.clusters.design_effect));
  check.limit = 1.0;
  check.text = std::to_string(num) + " of " + std::to_string(used.size()) + " photos (" + names +
               (num > named ? ", …" : "") + ") are " + set->flip->words +
               " against the others: with these undone photos disagree " + text_of(check.value, 2) + " times less";
  return check;
}

void heed_kept_flips(const Check& check, Verdict& verdict) {
  verdict.checks.push_back(check);
  verdict.state = std::max(verdict.state, State::bad);
  verdict.exit_code = ExitCode::not_trusted;
  verdict.sentence = "Not to be trusted: " + check.text;
  verdict.to_add = take_as_stored;
}

void heed_flipped_photos(const CalibrateReport& report, Verdict& verdict) {
  constexpr double few = 0.25, single = 1.0;
  double num_used = 0.0, num_flipped = 0.0;
  const Flip* how = nullptr;
  for (const ViewFit& view : report.views) {
    num_used += view.used ? 1.0 : 0.0;
    const auto* const flip =
        std::ranges::find_if(flips, [&](const Flip& each) { return view.reason.ends_with(flip_words(each)); });
    if (view.used || flip == flips.end()) continue;
    num_flipped += 1.0;
    how = flip;
  }
  const double share = num_flipped / std::max(1.0, num_used + num_flipped);
  if (!(share > few || num_flipped > single)) return;  // a centre that jumped to its mirror image looks the same
  Check check{.name = "one orientation", .state = State::care, .value = 100.0 * share, .limit = 100.0 * few};
  check.unit = "%";
  check.figure = "photos";
  check.text =
      text_of(num_flipped, 4) + " of " + text_of(num_used + num_flipped, 4) + " photos are " + how->words +
      " against the others, of which the stated lens is: that it is theirs, only their number says; a centre that " +
      "jumped to the other side of the image's would show the same";
  const bool was_good = verdict.state == State::good;
  heed(check, take_as_stored, verdict);
  if (!was_good) verdict.sentence += "; " + check.text;
  verdict.to_add = take_as_stored;
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
