// Checks whether a change of the intrinsics that the filter followed really was one.
#include "alidade/observe/checks/followed_changes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace alidade {
namespace {

constexpr double clearly = 5.0;  // σ

/// Consecutive rejected rows between two accepted ones, `before` and `after`.
struct RejectedRun {
  std::size_t before = 0, begin = 0, after = 0;
  [[nodiscard]] std::size_t length() const { return after - begin; }
};

bool is_taken_in(const IntrinsicsEstimate& row) { return row.has_value && row.event != ObserveEvent::burst; }

/// The σ of rejected rows does not locate a change: it lies between the accepted rows around them.
bool differ_clearly(const IntrinsicsEstimate& a, const IntrinsicsEstimate& b) {
  const Eigen::Array4d variance = a.sigma.array().square() + b.sigma.array().square();
  return ((a.values() - b.values()).array().square() > clearly * clearly * variance).any();
}

std::vector<RejectedRun> rejected_runs(const std::vector<IntrinsicsEstimate>& rows) {
  std::vector<RejectedRun> runs;
  std::optional<std::size_t> before;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (!is_taken_in(rows[k])) continue;
    if (before && k > *before + 1) runs.push_back({*before, *before + 1, k});
    before = k;
  }
  return runs;
}

/// Frames that neither the old camera nor another explains, followed by another camera: no zoom begins like that.
/// (In a zoom the first frame is rejected and the second followed; after outliers the camera is the same as before.)
std::optional<Check> unexplained(const std::vector<IntrinsicsEstimate>& rows, const RotationLog& log) {
  constexpr std::size_t min_frames = 4;
  std::optional<RejectedRun> longest;
  for (const RejectedRun& run : rejected_runs(rows)) {
    if (run.length() < std::max(min_frames, longest ? longest->length() + 1 : 0)) continue;
    if (differ_clearly(rows[run.before], rows[run.after])) longest = run;
  }
  if (!longest) return std::nullopt;
  return Check{"changes followed",
               State::care,
               "from " + row_time_text(log.rows[longest->begin].t_s) + " to " +
                   row_time_text(log.rows[longest->after].t_s) +
                   " no camera explains the pixels, and after that another one does: more has changed than fx, fy, cx, "
                   "cy (a bump of the camera; distortion or a roll that goes with the zoom; points renumbered)",
               static_cast<double>(longest->length()),
               static_cast<double>(min_frames),
               "frames",
               "residuals"};
}

/// A change of fx, fy, cx, cy that the filter followed: last row before it and first row after it.
struct FollowedChange {
  std::size_t before = 0, after = 0;
};

std::vector<FollowedChange> followed_changes(const std::vector<IntrinsicsEstimate>& rows) {
  std::vector<FollowedChange> changes;
  std::optional<std::size_t> last, before;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const ObserveEvent event = rows[k].event;
    if (event == ObserveEvent::zoom && !before) before = last;
    if (event == ObserveEvent::restart) before.reset();
    if (before && (event == ObserveEvent::zoom_end || k + 1 == rows.size())) {
      changes.push_back({*before, k});
      before.reset();
    }
    if (is_taken_in(rows[k])) last = k;
  }
  return changes;
}

/// In a zoom the principal point moves by a few hundredths of the change of the focal length, in Fang 2011 by the full
/// change; if it moves much more, the camera was bumped.
std::optional<Check> moved_centre(const std::vector<IntrinsicsEstimate>& rows, const RotationLog& log) {
  constexpr double most = 3.0;
  for (const FollowedChange& change : followed_changes(rows)) {
    const IntrinsicsEstimate &a = rows[change.before], &b = rows[change.after];
    if (!a.sigma.allFinite() || !b.has_value || !b.sigma.allFinite()) continue;
    const double zoomed_px = std::abs(b.fx - a.fx), moved_px = std::hypot(b.cx - a.cx, b.cy - a.cy);
    const double sigma_px = std::sqrt(a.sigma.tail<2>().squaredNorm() + b.sigma.tail<2>().squaredNorm());
    if (moved_px - clearly * sigma_px < most * zoomed_px) continue;
    return Check{
        "centre stays",
        State::care,
        "at " + row_time_text(log.rows[change.before].t_s) + " cx, cy move by " + text_of(moved_px, 2) +
            " px while fx changes by " + text_of(zoomed_px, 2) +
            " px: no zoom does that; was the camera or its lens bumped, or the head zeroed again? part the log "
            "there, each part has a mounting of its own",
        moved_px,
        most * zoomed_px,
        "px",
        "intrinsics"};
  }
  return std::nullopt;
}

/// Rows between two followed changes, with the squares of their innovations and the degrees of freedom.
struct Span {
  std::size_t begin = 0, end = 0;
  double sum_nis = 0.0, sum_dof = 0.0;
  [[nodiscard]] double nis_per_dof() const { return sum_nis / sum_dof; }
};

std::vector<Span> spans_of(const std::vector<IntrinsicsEstimate>& rows) {
  std::vector<Span> spans(1);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const ObserveEvent event = rows[k].event;
    if (event == ObserveEvent::zoom || event == ObserveEvent::zoom_end || event == ObserveEvent::restart)
      spans.push_back({k, k, 0.0, 0.0});
    spans.back().end = k;
    if (!is_taken_in(rows[k]) || event == ObserveEvent::zoom || !(rows[k].nis_dof > 0)) continue;
    spans.back().sum_nis += rows[k].nis;
    spans.back().sum_dof += rows[k].nis_dof;
  }
  return spans;
}

/// A change of anything but the intrinsics stays in the residuals: after one of the changes they are larger.
std::optional<Check> worst_span(const std::vector<IntrinsicsEstimate>& rows, const RotationLog& log) {
  constexpr double most = 1.25;  // over the variance elsewhere
  const std::vector<Span> spans = spans_of(rows);
  std::optional<Check> worst;
  for (std::size_t i = 1; i < spans.size(); ++i) {
    const Span& span = spans[i];
    Span others;
    for (const Span& other : spans) {
      if (&other == &span) continue;
      others.sum_nis += other.sum_nis;
      others.sum_dof += other.sum_dof;
    }
    if (!(span.sum_dof > 0.0 && others.sum_dof > 0.0)) continue;
    const double ratio = span.nis_per_dof() / others.nis_per_dof();
    const double chance = clearly * std::sqrt(2.0 / span.sum_dof + 2.0 / others.sum_dof);
    if (ratio < std::max(most, 1.0 + chance) || (worst && ratio < worst->value)) continue;
    worst = Check{"times between zooms agree",
                  State::care,
                  "from " + row_time_text(log.rows[span.begin].t_s) + " to " + row_time_text(log.rows[span.end].t_s) +
                      " innovations are " + text_of(std::sqrt(ratio), 3) +
                      " times those of the other times: more has changed than fx, fy, cx, cy (a bump of the camera; "
                      "distortion or a roll that goes with the zoom)",
                  ratio,
                  most,
                  "",
                  "nis"};
  }
  return worst;
}

}  // namespace

void widen_before_zooms(std::vector<IntrinsicsEstimate>& rows) {
  constexpr std::size_t num_undecided = 2, num_unnoticed = 30;
  constexpr double hardly_seen = 6.0;  // σ of one frame: about the change that its χ² test rejects, for 45 points
  std::optional<std::size_t> last;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (rows[k].event == ObserveEvent::zoom && last) {
      const Eigen::Array4d unseen = hardly_seen * rows[k].sigma.array();
      for (std::size_t i = *last + 1 > num_unnoticed ? *last + 1 - num_unnoticed : 0; i < k; ++i) {
        Eigen::Array4d change = (rows[k].values() - rows[i].values()).array().abs();
        if (i + num_undecided <= *last) change = change.min(unseen);
        if (rows[i].has_value) rows[i].sigma = (rows[i].sigma.array().square() + change.square()).sqrt();
      }
    }
    if (is_taken_in(rows[k])) last = k;
  }
}

std::vector<Check> followed_checks(const std::vector<IntrinsicsEstimate>& rows, const RotationLog& log) {
  std::vector<Check> checks;
  if (rows.size() != log.rows.size()) return checks;
  if (auto check = unexplained(rows, log)) checks.push_back(*std::move(check));
  if (auto check = moved_centre(rows, log)) checks.push_back(*std::move(check));
  if (auto check = worst_span(rows, log)) checks.push_back(*std::move(check));
  return checks;
}

}  // namespace alidade
