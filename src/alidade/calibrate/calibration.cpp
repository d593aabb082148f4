#include "alidade/calibrate/calibration.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>
#include <utility>

#include "alidade/calibrate/changes/lens_change.h"
#include "alidade/calibrate/changes/photo_effects.h"
#include "alidade/calibrate/changes/rolling_shutter.h"
#include "alidade/calibrate/changes/two_lenses.h"
#include "alidade/calibrate/checks/assumed.h"
#include "alidade/calibrate/checks/better_model.h"
#include "alidade/calibrate/checks/calibration_verdict.h"
#include "alidade/calibrate/checks/corner_numbering.h"
#include "alidade/calibrate/checks/judge.h"
#include "alidade/calibrate/checks/model_errors.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/calibrate/study.h"
#include "alidade/description/natural_order.h"

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

/// The views in use, in the order in which the photos were taken: a shell gives img10 before img2.
struct OrderTaken {
  std::vector<std::size_t> of_used;  ///< Position among the views in use.
  std::vector<BoardView> views;
  std::vector<std::string> photos;
};

OrderTaken order_taken(const Calibration& result) {
  const std::vector<BoardView> used = used_views(result.board_views, result, result.board_views.size());
  OrderTaken taken;
  taken.of_used.resize(used.size());
  std::iota(taken.of_used.begin(), taken.of_used.end(), std::size_t{0});
  if (std::ranges::is_sorted(used, {}, &BoardView::photo)) {
    std::ranges::stable_sort(taken.of_used, natural_less, [&](std::size_t k) { return used[k].photo; });
  }
  for (const std::size_t k : taken.of_used) {
    taken.views.push_back(used[k]);
    taken.photos.push_back(used[k].photo);
  }
  return taken;
}

/// A change of the lens over the photos that calibrations of its parts confirm.
LensChangeStudy find_change(std::span<const ViewScore> scores, const OrderTaken& taken, const Calibration& result) {
  std::vector<ViewScore> in_order;
  for (std::size_t k = 0; !scores.empty() && k < taken.of_used.size(); ++k)
    in_order.push_back(scores[taken.of_used[k]]);
  LensChangeStudy study = lens_change(in_order, result);
  while (study.change && !is_confirmed(*study.change, result.board, taken.views, result.config, result)) {
    study.change.reset();
    if (study.rivals.empty()) break;
    study.change = std::move(study.rivals.front());
    study.rivals.erase(study.rivals.begin());
  }
  return study;
}

/// Photos of two lenses: looked for where photos disagree for no other reason.
std::optional<TwoLenses> find_two_lenses(std::span<const ViewScore> scores, const Calibration& result,
                                         std::vector<std::string>& photos) {
  std::vector<BoardView> views;  // whole: a lens of its own makes outliers of corners
  for (std::size_t k = 0; k < result.board_views.size(); ++k) {
    if (!result.views[k].used) continue;
    views.push_back(result.board_views[k]);
    photos.push_back(result.board_views[k].photo);
  }
  return two_lenses(result.board, views, scores, result.config, result);
}

/// Whether the verdict has a cause already, of which photos disagree as well.
bool has_a_cause(const Calibration& result) {
  if (!result.study.print_error.empty() || !result.study.lens_error.empty()) return true;
  constexpr std::array<std::string_view, 5> causes{"mirrored", "board flat", "principal point", "one lens",
                                                   "given values"};
  return std::ranges::any_of(result.verdict.checks, [&](const Check& check) {
    return check.state != State::good && std::ranges::find(causes, check.name) != causes.end();
  });
}

/// The scores beside a change over the photos, to first order: what it does not explain.
std::vector<ViewScore> beside(const LensChange& change, std::vector<ViewScore> scores, const OrderTaken& taken) {
  for (std::size_t i = 0; i < taken.of_used.size(); ++i) {
    ViewScore& view = scores[taken.of_used[i]];
    view.gradient += view.information * (change.size * change.course[i] * change.direction);
  }
  return scores;
}

/// A centre or a focal length that each photo has its own of, where it explains what a proved change does not: of
/// photos that scatter some order always shows a jump.
std::optional<PhotoEffect> effect_beside(const LensChangeStudy& change, std::vector<ViewScore> scores,
                                         const OrderTaken& taken, const Calibration& result) {
  if (!change.change || !change.change->is_proved || scores.empty() || has_a_cause(result)) return std::nullopt;
  return photo_effect(beside(*change.change, std::move(scores), taken), result);
}

/// Names why the photos disagree: two lenses, or a centre or a focal length that each photo has its own of. A change
/// over the photos goes before, where it matters.
void explain_disagreement(std::span<const ViewScore> scores, bool changes, Calibration& result) {
  std::vector<std::string> photos;
  const auto two = changes ? std::nullopt : find_two_lenses(scores, result, photos);
  if (two) return heed_two_lenses(*two, photos, result.verdict);
  if (changes || has_a_cause(result)) return;
  if (const auto effect = photo_effect(scores, result)) heed_photo_effect(*effect, result.verdict);
}

/// Why photos disagree, by a change over them or without one.
void heed_changes(LensChangeStudy change, const std::optional<Check>& flips, const std::vector<ViewScore>& scores,
                  const OrderTaken& taken, Calibration& result) {
  const bool is_explained = result.verdict.state == State::good || has_a_cause(result);
  const auto motion = is_explained ? std::nullopt : readout_motion(result.board_views, result);
  const std::optional<PhotoEffect> effect = motion ? std::nullopt : effect_beside(change, scores, taken, result);
  if (effect || motion || flips) change.change.reset();
  heed_change(change, taken.photos, result.verdict);
  if (flips) return heed_kept_flips(*flips, result.verdict);
  if (motion) return heed_readout_motion(*motion, result.verdict);
  if (effect) return heed_photo_effect(*effect, result.verdict);
  if (result.verdict.state == State::good) return;
  const bool changes = std::ranges::any_of(result.verdict.checks, [](const Check& check) {
    return check.name == "same lens" && check.state != State::good;
  });
  explain_disagreement(scores, changes, result);
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

/// A print that departs from its grid: every point is estimated where the shape is to be chosen. Else, and where the
/// lens departs from its model, σ includes it. The text is left where that is proved and matters. What a few parameters
/// say at 4σ needs no transfer: every point, learned on half of the photos, brings more noise than the print's error.
ModelErrors settle_model(Calibration& result) {
  if (result.config.board_shape == BoardShape::free) return {};
  constexpr double care_sigmas = 2.0;
  ModelErrors errors = model_errors(result.board_views, result);
  const bool matters = errors.is_proved && errors.moves > care_sigmas;
  if (!matters) errors.text.clear();
  const BoardShape asked = result.asked_shape;
  if (matters && !errors.is_of_lens && (asked == BoardShape::automatic || asked == BoardShape::free)) {
    CalibrateConfig free = result.config;
    free.board_shape = BoardShape::free;
    if (solve_again(free, result)) {
      result.config = std::move(free);
      errors.unseen.clear();  // that is another solve
      return errors;
    }
  }
  result.camera.cov += errors.cov;
  return errors;
}

/// With all causes that are found: those of which photos disagree as well go first.
void give_verdict(const std::optional<Check>& flips, const std::optional<GivenValues>& given, LensChangeStudy change,
                  const std::vector<ViewScore>& scores, const OrderTaken& taken, Calibration& result) {
  result.verdict = calibration_verdict(result, result.study, result.board_views, result.config, result.next);
  heed_flipped_photos(result, result.verdict);
  if (given && given->photos_agree) heed_given_values(*given, result.verdict);
  heed_changes(std::move(change), flips, scores, taken, result);
  if (given && !given->photos_agree) heed_given_values(*given, result.verdict);
  if (const auto rival = rival_model(result.board, result.board_views, result.config, result))
    heed_rival_model(*rival, result.verdict);
  heed_assumptions(result.assumed, result.verdict);
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
  reject_flipped_photos(board, result.size, result.config, result.board_views, result);
  const std::optional<Check> flips = kept_flips(board, result.config, result.board_views, result);
  const std::vector<ShapeTransfer> transfers = settle_shape(result, progress);
  const ModelErrors errors = settle_model(result);
  const auto given = test_given_values(board, result.board_views, result.config, result);
  if (given) result.camera.cov += given->cov;
  name_flipped_photos(board, result.board_views, result);
  result.counts = count_photos(result);
  const std::vector<ViewScore> scores = view_scores(board, result.config, result.board_views, result);
  result.assumed = count_assumptions(board, result.config, result.board_views, scores, air, result);
  if (auto row = not_tested(errors.unseen, result)) result.assumed.push_back(std::move(*row));
  const OrderTaken taken = order_taken(result);
  LensChangeStudy change = find_change(scores, taken, result);
  if (given && given->contradict && given->photos_agree) change.change.reset();  // it is of the wrong value
  if (change.change) count_change(*change.change, result);
  result.study = study_calibration(board, result.board_views, result.config, result,
                                   max_informative(transfers, result.config.board_shape), progress);
  (errors.is_of_lens ? result.study.lens_error : result.study.print_error) = errors.text;
  result.study.lens_remedy = errors.is_of_lens ? errors.remedy : "";
  result.next = plan_next_photos(result.camera, shared_noise_px(result), result.board_points, 1, progress);
  result.port = port_residual(result.camera);
  give_verdict(flips, given, change, scores, taken, result);
  return result;
}

}  // namespace alidade
