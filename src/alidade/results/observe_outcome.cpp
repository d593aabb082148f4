#include "alidade/results/observe_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/detect/video_log.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/results/documents/observe_document.h"
#include "alidade/tables/pairs_file.h"
#include "alidade/tables/rotation_log_file.h"

namespace alidade {
namespace {

void say_log(const ObserveReport& report, std::vector<std::string>& lines) {
  for (const ObservedQuantity& quantity : report.quantities) {
    const std::string bound = is_assumed(report, quantity) ? "; assumed, these pixels do not determine it"
                              : std::isfinite(quantity.bound)
                                  ? fmt::format("; this log's bound {:.2g}", 3.0 * quantity.bound)
                                  : "";
    lines.push_back(
        fmt::format("{:<11} {:.6g} ± {:.2g}   (3σ{})", quantity.name, quantity.value, 3.0 * quantity.sigma, bound));
  }
  lines.push_back(fmt::format("σ of a pixel {:.3g} px, {}", report.sigma_px,
                              report.sigma_is_estimated ? "estimated from the residuals" : "as given"));
  int outliers = 0;
  for (const ObserveNote& note : report.events) {
    if (note.event == ObserveEvent::burst || note.event == ObserveEvent::slip) {
      ++outliers;
    } else {
      lines.push_back(fmt::format("{:8.2f} s  {}", note.t_s, event_name(note.event)));
    }
  }
  if (outliers > 0) lines.push_back(fmt::format("{} frames or points rejected as outliers", outliers));
}

void say_photos(const ObserveReport& report, std::vector<std::string>& lines) {
  for (const ObservedQuantity& quantity : report.quantities) {
    lines.push_back(fmt::format("{:<11} {:.6g} ± {:.2g}   (3σ)", quantity.name, quantity.value, 3.0 * quantity.sigma));
  }
  lines.push_back(fmt::format("σ of a pixel {:.3g} px; {} of {} matches kept; rotated by up to {:.3g}°",
                              report.sigma_px, report.matches.kept, report.matches.given,
                              report.motion.span_rad / degree));
}

void say_input(const ObserveReport& report, std::vector<std::string>& lines) {
  if (report.found_matches) {
    std::size_t count = 0;
    for (const MatchedPair& pair : report.found_matches->pairs) count += pair.matches.size();
    lines.push_back(fmt::format("{} photos, {} matches between {} pairs of them", report.photos.size(), count,
                                report.found_matches->pairs.size()));
  } else if (report.size_is_guessed && report.width_px > 0) {
    lines.push_back(fmt::format("image size {}x{} is the least that holds the points: give --size WIDTHxHEIGHT",
                                report.width_px, report.height_px));
  }
  for (std::size_t i = 0; i < report.photos.size(); ++i) {
    if (report.photos[i].is_used || report.photos[i].reason.empty()) continue;
    lines.push_back(fmt::format("rejected: {} {}", report.photo_names[i], report.photos[i].reason));
  }
}

}  // namespace

JobOutcome outcome_of(const ObserveReport& report) {
  JobOutcome outcome;
  outcome.document.command = "observe";
  fill_observation(report, outcome.document);
  outcome.document.verdict = report.verdict;
  say_input(report, outcome.lines);
  if (report.found_matches) outcome.files.push_back({"pairs.csv", pairs_csv(*report.found_matches)});
  const bool is_answered = is_estimate(static_cast<int>(report.verdict.exit_code));
  if (is_answered) {
    report.photos.empty() ? say_log(report, outcome.lines) : say_photos(report, outcome.lines);
    outcome.files.push_back({"camera.yaml", camera_text(report.camera, CameraFormat::alidade)});
    note_verdict({"camera.yaml"}, outcome);
  }
  if (!is_answered) return outcome;
  std::vector<double> times;
  for (const RotationRow& row : report.log.rows) times.push_back(row.t_s);
  outcome.files.push_back({"intrinsics.csv", intrinsics_csv(times, report.steps)});
  return outcome;
}

void add_video(const VideoLog& video, JobOutcome& outcome) {
  outcome.lines.insert(
      outcome.lines.begin(),
      fmt::format("{} frames, {} points followed, {} used; σ of a pixel {:.2g} px as the tracker sees it",
                  video.num_frames, video.num_tracks, video.log.num_points, video.median_sigma_px));
  outcome.files.insert(outcome.files.begin(), {"points.csv", rotation_log_csv(video.log)});
}

}  // namespace alidade
