#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "alidade/estimation/verdict.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig/rig_work.h"

namespace alidade {
namespace {

using Status = RigReport::Status;

constexpr double usual_rad = 0.3 * degree;  // more is worse than any encoder

/// Of a hypothesis that is of interest only if σ of a reading is below this: the right one settles in a few iterations,
/// a wrong one has no minimum to reach.
Effort effort_below(double sigma_rad) {
  constexpr double margin = 1.5;
  return {.iterations = 20, .unsettled_rounds = 2, .max_sigma_rad = margin * sigma_rad};
}

/// What a wrong camera looks like: encoders worse than any encoder, views that contradict each other.
bool is_suspicious(const RigReport& report) {
  if (report.status == Status::mirrored) return false;
  if (report.status != Status::converged)
    return report.status == Status::no_convergence || report.status == Status::degenerate;
  return report.sigma_encoder_rad > usual_rad || report.chi2_per_dof() > 2.0 ||
         5 * report.views_dropped > report.views_used;
}

/// Another reading of the same table, by which its views may agree.
struct Misreading {
  std::string words;
  std::vector<HeadView> views;
  bool is_common = false;  ///< Tried where only a few views are rejected, too.
  std::string remedy = "give each view what its own pan and tilt encoders read";
};

/// Each view of a head, or of all, with the angles of the one before, or after.
std::vector<HeadView> shifted(std::span<const HeadView> given, std::optional<int> head, bool is_late) {
  std::vector<HeadView> views(given.begin(), given.end());
  std::vector<std::size_t> own;
  for (std::size_t v = 0; v < given.size(); ++v)
    if (!head || given[v].head == *head) own.push_back(v);
  for (std::size_t k = 0; k < own.size(); ++k)
    views[own[k]].pan_tilt_rad = given[own[(k + (is_late ? 1 : own.size() - 1)) % own.size()]].pan_tilt_rad;
  return views;
}

/// The corners of a head counted from the other end of the board: its boards seem to stand upside down.
Misreading turned_corners(std::span<const HeadView> given, int head, int than, int last) {
  Misreading turned{"the corners of head " + std::to_string(head) +
                        " are numbered from the other end of the board than those of head " + std::to_string(than) +
                        ": the views agree with them counted backwards",
                    std::vector<HeadView>(given.begin(), given.end()), true,
                    "number the corners of all heads from the same end of the board (of head " + std::to_string(head) +
                        ": " + std::to_string(last) + " - corner)"};
  for (HeadView& view : turned.views)
    if (view.head == head)
      for (Corner& corner : view.seen.corners) corner.index = last - corner.index;
  return turned;
}

/// Of all heads, then of each.
std::vector<Misreading> misreadings(std::span<const HeadView> given, std::span<const Eigen::Vector3d> points_in_board) {
  std::set<int> ids;
  for (const HeadView& view : given) ids.insert(view.head);
  std::vector<std::optional<int>> heads{std::nullopt};
  if (ids.size() > 1) heads.insert(heads.end(), ids.begin(), ids.end());
  std::vector<Misreading> all;
  if (half_turn_of(points_in_board))
    for (const int id : ids)
      if (id != *ids.begin())
        all.push_back(turned_corners(given, id, *ids.begin(), static_cast<int>(points_in_board.size()) - 1));
  for (const std::optional<int> head : heads) {
    const std::string of = head ? " of head " + std::to_string(*head) : "";
    std::vector<HeadView> exchanged(given.begin(), given.end());
    for (HeadView& view : exchanged)
      if (!head || view.head == *head) view.pan_tilt_rad.reverseInPlace();
    all.push_back({"pan and tilt" + of + " are exchanged: the views agree with each in the other's column",
                   std::move(exchanged), true});
    all.push_back(
        {"the angles" + of + " are those of the view before: the views agree with each row's angles one row earlier",
         shifted(given, head, true)});
    all.push_back(
        {"the angles" + of + " are those of the view after: the views agree with each row's angles one row later",
         shifted(given, head, false)});
  }
  return all;
}

constexpr double far = 2.0, as_good = 1.2;  // of σ of a reading

/// Whether a change of the table makes its views agree far better: in their readings, or in that none is rejected.
bool is_far_better(const RigReport& otherwise, const RigReport& given) {
  if (otherwise.status != Status::converged || otherwise.views_dropped > given.views_dropped) return false;
  const double ratio = otherwise.sigma_encoder_rad / given.sigma_encoder_rad;
  return (otherwise.sigma_encoder_is_estimated && ratio < 1.0 / far) ||
         (otherwise.views_dropped + 2 <= given.views_dropped && 20 * otherwise.views_dropped < otherwise.views_used &&
          ratio < as_good);
}

/// Why views that contradict each other may do so: as they are read otherwise, they agree. Of views of which a few were
/// rejected, or whose readings scatter, only whether pan and tilt are exchanged, or corners counted backwards.
void look_for_misreading(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                         const std::map<int, Camera>& cameras, const RigConfig& config, const Progress& progress,
                         RigReport& report) {
  constexpr std::size_t min_views = 8;
  constexpr double uneasy_rad = 0.05 * degree;
  const bool is_bad = is_suspicious(report);
  const bool is_uneasy = 20 * report.views_dropped > report.views_used ||
                         (report.sigma_encoder_is_estimated && report.sigma_encoder_rad > uneasy_rad);
  if (report.status == Status::degrees || report.status == Status::mirrored || views.size() < min_views) return;
  if (!is_bad && !is_uneasy) return;
  const Effort effort = effort_below(is_bad ? usual_rad : as_good * report.sigma_encoder_rad);
  std::optional<RigReport> best;
  for (const Misreading& other : misreadings(views, points_in_board)) {
    if (!is_bad && !other.is_common) continue;
    const RigReport otherwise = calibrated_with(other.views, points_in_board, cameras, config, {}, progress, effort);
    if (otherwise.status != Status::converged || is_suspicious(otherwise)) continue;
    if (!is_bad && !is_far_better(otherwise, report)) continue;
    if (best && std::pair(otherwise.views_dropped, otherwise.sigma_encoder_rad) >=
                    std::pair(best->views_dropped, best->sigma_encoder_rad))
      continue;
    best = otherwise;
    best->misreading = other.words;
    best->misreading_remedy = other.remedy;
  }
  if (!best) return;
  report.status = Status::misread;
  report.misreading = best->misreading;
  report.misreading_remedy = best->misreading_remedy;
}

/// The boards whose views' readings are corrected by more than others', or of which two views or more are rejected:
/// all but a few of those that are, as two poses of a board explain its own views only.
std::set<int> odd_boards(std::span<const HeadView> views, const RigReport& report) {
  constexpr double min_ratio = 2.0;
  constexpr int few = 10;                            // one in so many; in the end one in twenty
  std::map<int, std::pair<double, double>> squares;  // and how many
  std::map<int, int> rejected;
  double sum = 0.0, num = 0.0;
  int all_rejected = 0;
  for (std::size_t v = 0; v < views.size() && v < report.views.size(); ++v) {
    if (!report.views[v].used) {
      ++rejected[views[v].board];
      ++all_rejected;
      continue;
    }
    const double square = report.views[v].reading_correction_rad.squaredNorm();
    squares[views[v].board].first += square;
    squares[views[v].board].second += 1.0;
    sum += square;
    num += 1.0;
  }
  std::set<int> odd;
  for (const auto& [board, of] : squares)
    if (of.first * num > min_ratio * sum * of.second) odd.insert(board);
  for (const auto& [board, num_rejected] : rejected)
    if (num_rejected > 1 && few * (all_rejected - num_rejected) <= static_cast<int>(views.size())) odd.insert(board);
  return odd;
}

/// A board that moved between two of its views: with another pose from there on the readings agree far better. Noise
/// that is estimated from the residuals hides it; two poses instead of one would by chance lower it by a few
/// hundredths.
void look_for_moved_board(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                          const std::map<int, Camera>& cameras, const RigConfig& config, const Progress& progress,
                          RigReport& report) {
  constexpr std::size_t min_views = 2;
  int unused = 0;
  for (const HeadView& view : views) unused = std::max(unused, view.board + 1);
  const Effort effort = effort_below((report.views_dropped > 1 ? as_good : 1.0 / far) * report.sigma_encoder_rad);
  RigReport best = report;
  std::string words;
  for (const int board : odd_boards(views, report)) {
    std::vector<std::size_t> own;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (views[v].board == board) own.push_back(v);
    for (std::size_t first = min_views; first + min_views <= own.size(); ++first) {
      std::vector<HeadView> moved(views.begin(), views.end());
      for (std::size_t k = first; k < own.size(); ++k) moved[own[k]].board = unused;
      const RigReport otherwise = calibrated_with(moved, points_in_board, cameras, config, {}, progress, effort);
      if (!is_far_better(otherwise, report) || otherwise.views_dropped > best.views_dropped ||
          (otherwise.views_dropped == best.views_dropped && otherwise.sigma_encoder_rad > best.sigma_encoder_rad))
        continue;
      best = otherwise;
      words = "board " + std::to_string(board) + " moved between " + views[own[first - 1]].seen.photo + " and " +
              views[own[first]].seen.photo + ": with two poses of it the views agree (σ of a reading " +
              text_of(otherwise.sigma_encoder_rad / degree, 2) + "° for " +
              text_of(report.sigma_encoder_rad / degree, 2) + "°, " + std::to_string(otherwise.views_dropped) +
              " rejected for " + std::to_string(report.views_dropped) + ")";
    }
  }
  if (words.empty()) return;
  report.status = Status::misread;
  report.misreading = words;
  report.misreading_remedy = "give the views of a board that was moved a board number of their own";
}

}  // namespace

RigReport calibrate_rig(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                        const std::map<int, Camera>& cameras, const RigConfig& config, const Progress& progress) {
  RigReport report = calibrated_with(views, points_in_board, cameras, config, {}, progress);
  if (cameras.size() == 2 && is_suspicious(report)) {
    std::map<int, Camera> swapped = cameras;
    std::swap(swapped.begin()->second, swapped.rbegin()->second);
    const RigReport otherwise =
        calibrated_with(views, points_in_board, swapped, config, {}, progress, effort_below(usual_rad));
    if (otherwise.status == Status::converged && !is_suspicious(otherwise)) report.status = Status::swapped;
  }
  const bool is_alone = report.status == Status::converged || report.status == Status::no_convergence ||
                        report.status == Status::degenerate;
  if (is_alone) look_for_misreading(views, points_in_board, cameras, config, progress, report);
  if (report.status == Status::converged)
    look_for_moved_board(views, points_in_board, cameras, config, progress, report);
  return report;
}

RigReport calibrate_rig_by_need(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                const std::map<int, Camera>& cameras, const RigConfig& config,
                                const Progress& progress) {
  RigReport report = calibrate_rig(views, points_in_board, cameras, config, progress);
  if (report.status != Status::converged) return report;
  return freed_by_need(std::move(report), views, points_in_board, cameras, config, progress);
}

}  // namespace alidade
