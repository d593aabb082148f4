#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "alidade/estimation/verdict.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig/checks/indicated_lens.h"
#include "alidade/rig/checks/lens_of_views.h"
#include "alidade/rig/checks/misreadings.h"
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

constexpr double far = 2.0, as_good = 1.2;  // of σ of a reading

/// Whether a change of the table makes its views agree far better: in their readings, or in that none is rejected.
bool is_far_better(const RigReport& otherwise, const RigReport& given) {
  if (otherwise.status != Status::converged || otherwise.views_dropped > given.views_dropped) return false;
  const double ratio = otherwise.sigma_encoder_rad / given.sigma_encoder_rad;
  return (otherwise.sigma_encoder_is_estimated && ratio < 1.0 / far) ||
         (otherwise.views_dropped + 2 <= given.views_dropped && 20 * otherwise.views_dropped < otherwise.views_used &&
          ratio < as_good);
}

constexpr std::size_t min_views = 8;  // of a table that is read otherwise

/// A report that says how its table was misread.
RigReport misread(RigReport report, const Misreading& how) {
  report.status = Status::misread;
  report.misreading = how.words;
  report.misreading_remedy = how.remedy;
  return report;
}

/// Of those by which the views agree, the one by which the fewest are rejected, and then the best.
class BestMisreading {
 public:
  explicit BestMisreading(const Work& table, const std::map<int, Camera>& cameras, const Effort& effort)
      : table_(table), cameras_(cameras), effort_(effort) {}

  /// `is_better`: what it must be, beside a rig that explains its views.
  template <class IsBetter>
  void try_one(const Misreading& other, const IsBetter& is_better) {
    const RigReport otherwise = calibrated_with(other.views, table_.problem.points_in_board, cameras_, table_.config,
                                                {}, table_.progress, effort_);
    if (otherwise.status != Status::converged || is_suspicious(otherwise) || !is_better(otherwise)) return;
    const std::pair left{otherwise.views_dropped, otherwise.sigma_encoder_rad};
    if (best_ && left >= least_) return;
    least_ = left;
    best_ = other;
  }

  [[nodiscard]] const std::optional<Misreading>& best() const { return best_; }

 private:
  const Work& table_;
  const std::map<int, Camera>& cameras_;
  Effort effort_;
  std::optional<Misreading> best_;
  std::pair<int, double> least_;
};

/// Corners that no pose of the board explains: it is another, or they are numbered otherwise.
std::optional<RigReport> misread_board(const Work& table) {
  const std::string words = corners_of_another_board(table);
  if (words.empty()) return std::nullopt;
  RigReport report = table.report;
  report.status = Status::misread;
  report.misreading = words;
  report.misreading_remedy = "check --board COLSxROWS, that corners are numbered row by row, and the camera files";
  return report;
}

/// Rotations of the boards that contradict each other, and agree once the angles are read otherwise: before anything is
/// solved with angles that cannot be.
std::optional<RigReport> misread_by_rotations(const Work& table, const std::map<int, Camera>& cameras) {
  constexpr std::size_t most_tried = 3;
  if (table.given.size() < min_views || mirrored_head(table) ||
      !(rotation_misfit_rad(table, table.given) > suspicious_misfit_rad))
    return std::nullopt;
  std::vector<Misreading> others = misreadings(table);
  std::erase_if(others, [](const Misreading& other) { return !(other.misfit_left.value_or(1.0) < clear_misfit); });
  std::ranges::stable_sort(others, {}, &Misreading::misfit_left);
  BestMisreading tried(table, cameras, effort_below(usual_rad));
  for (std::size_t k = 0; k < std::min(most_tried, others.size()); ++k)
    tried.try_one(others[k], [](const RigReport&) { return true; });
  if (!tried.best()) return std::nullopt;
  return misread(table.report, *tried.best());
}

/// Why views that contradict each other may do so: as they are read otherwise, they agree. Of views of which a few were
/// rejected, or whose readings scatter, only what is common.
void look_for_misreading(const Work& table, const std::map<int, Camera>& cameras, RigReport& report) {
  constexpr double uneasy_rad = 0.05 * degree;
  const bool is_bad = is_suspicious(report);
  const bool is_uneasy = 20 * report.views_dropped > report.views_used ||
                         (report.sigma_encoder_is_estimated && report.sigma_encoder_rad > uneasy_rad);
  if (table.given.size() < min_views || (!is_bad && !is_uneasy)) return;
  BestMisreading tried(table, cameras, effort_below(is_bad ? usual_rad : as_good * report.sigma_encoder_rad));
  const auto is_better = [&](const RigReport& otherwise) {
    if (!is_bad) return is_far_better(otherwise, report);
    return report.status != Status::converged || otherwise.sigma_encoder_rad < report.sigma_encoder_rad / far ||
           otherwise.views_dropped + 2 <= report.views_dropped;
  };
  for (const Misreading& other : misreadings(table))
    if (is_bad || other.is_common) tried.try_one(other, is_better);
  if (tried.best()) report = misread(std::move(report), *tried.best());
}

/// A lens is not as its file says: with the one that the residuals indicate the views agree far better.
bool is_lens_off(const Work& table, const std::map<int, Camera>& cameras, const RigReport& report) {
  constexpr int max_lenses = 3;  // corrected one after another
  if (report.status != Status::converged) return false;
  std::map<int, Camera> corrected = cameras;
  RigReport last = report;
  for (int round = 0; round < max_lenses && indicates_lens(last); ++round) {
    const auto next = with_indicated_lens(corrected, last);
    if (!next) return false;
    corrected = *next;
    last = calibrated_with(table.given, table.problem.points_in_board, corrected, table.config, {}, table.progress,
                           {.iterations = 20, .unsettled_rounds = 2});
    if (last.status != Status::converged) return false;
  }
  return !indicates_lens(last) && is_far_better(last, report);
}

/// Two cameras, each of which fits the other's head: their lenses are indicated no more. A lens file that is wrong is
/// so beside either head.
bool are_swapped(const Work& table, const std::map<int, Camera>& cameras, const RigReport& report) {
  if (cameras.size() != 2 || (!is_suspicious(report) && !indicates_lens(report))) return false;
  std::map<int, Camera> swapped = cameras;
  std::swap(swapped.begin()->second, swapped.rbegin()->second);
  const RigReport otherwise = calibrated_with(table.given, table.problem.points_in_board, swapped, table.config, {},
                                              table.progress, effort_below(usual_rad));
  return otherwise.status == Status::converged && !is_suspicious(otherwise) && !indicates_lens(otherwise);
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
      if (!report.views[v].misreading.empty()) continue;  // explained
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
  const FreedParams nothing;
  const Work table = prepared_work(views, points_in_board, cameras, config, nothing, progress);
  if (auto of_board = misread_board(table)) return std::move(*of_board);
  if (auto misread = misread_by_rotations(table, cameras)) return std::move(*misread);
  RigReport report = calibrated_with(views, points_in_board, cameras, config, nothing, progress);
  report.lens_of_views = lens_of_views(table);
  if (are_swapped(table, cameras, report)) report.status = Status::swapped;
  if (report.status == Status::swapped || is_lens_off(table, cameras, report)) return report;
  if (report.status == Status::converged || report.status == Status::no_convergence ||
      report.status == Status::degenerate)
    look_for_misreading(table, cameras, report);
  if (report.status == Status::converged)
    look_for_moved_board(views, points_in_board, cameras, config, progress, report);
  return report;
}

RigReport calibrate_rig_by_need(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                const std::map<int, Camera>& cameras, const RigConfig& config,
                                const Progress& progress) {
  RigReport report = calibrate_rig(views, points_in_board, cameras, config, progress);
  if (report.status != Status::converged) return report;
  const std::optional<RigCause> of_views = report.lens_of_views;
  RigReport freed = freed_by_need(std::move(report), views, points_in_board, cameras, config, progress);
  freed.lens_of_views = of_views;
  return freed;
}

}  // namespace alidade
