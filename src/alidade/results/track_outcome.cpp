#include "alidade/results/track_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/detect/video_observations.h"
#include "alidade/results/documents/track_document.h"
#include "alidade/tables/events_file.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

/// Of each head: how many, their mean, mean along the motion, slope over the image and autocorrelation, in σ of each.
DataTable innovations_table(std::span<const RigHead> heads, const TrackReport& report) {
  Numbers head, num, mean_u, mean_v, along, place_u, place_v, autocorrelation, nis;
  for (std::size_t h = 0; h < report.innovations.size(); ++h) {
    const HeadInnovations& of = report.innovations[h];
    head.push_back(heads[h].head.id);
    num.push_back(static_cast<double>(of.num));
    mean_u.push_back(of.mean.x());
    mean_v.push_back(of.mean.y());
    along.push_back(of.along);
    place_u.push_back(of.position_slope.x());
    place_v.push_back(of.position_slope.y());
    autocorrelation.push_back(of.autocorrelation);
    nis.push_back(of.nis_per_dof);
  }
  DataTable table{"innovations", {{"head", head}, {"num", num}}};
  table.columns.emplace_back("mean_u_sigma", rounded(std::move(mean_u), 4));
  table.columns.emplace_back("mean_v_sigma", rounded(std::move(mean_v), 4));
  table.columns.emplace_back("along_motion_sigma", rounded(std::move(along), 4));
  table.columns.emplace_back("slope_u_sigma", rounded(std::move(place_u), 4));
  table.columns.emplace_back("slope_v_sigma", rounded(std::move(place_v), 4));
  table.columns.emplace_back("colour", rounded(std::move(autocorrelation), 4));
  table.columns.emplace_back("nis_per_dof", rounded(std::move(nis), 4));
  return table;
}

/// Where σ of a pixel comes from.
const char* sigma_px_source(const TargetTrack& track) {
  const auto states_own = [](const TargetObservation& observation) { return observation.sigma_px > 0.0; };
  if (!track.observations.empty() && std::ranges::all_of(track.observations, states_own)) return "rows";
  if (track.sigma_px_is_found) return "residuals";
  return track.config.sigma_px ? "given" : "default";
}

void fill_track(const TargetTrack& report, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  estimate["rms_m"] = report.rms_m;
  estimate["mean_error_m"] = report.mean_error_m;
  if (!report.smoothed.empty()) estimate["smoothed_rms_m"] = report.smoothed_rms_m;
  estimate["nees_per_dof"] = report.nees_per_dof;
  estimate["nis_per_dof"] = report.nis_per_dof;
  estimate["pcrlb_m"] = report.pcrlb_m;
  estimate["sigma_a_m_s2"] = report.sigma_a_m_s2;
  estimate["sigma_a_is_estimated"] = report.sigma_a_is_found;
  if (report.sigma_px > 0.0) {
    estimate["sigma_px"] = report.sigma_px;
    estimate["sigma_px_from"] = sigma_px_source(report);
  }
  estimate["restarts"] = report.num_restarts;
  estimate["rig_errors_counted"] = report.errors_are_counted;
  estimate["sigma_raised_by"] = std::sqrt(report.inflation);
  if (!report.steps.empty() && report.steps.back().has_belief) {
    const Belief<6>& last = report.steps.back().belief;
    estimate["position_m"] = Numbers(last.x.data(), last.x.data() + 3);
    estimate["velocity_m_s"] = Numbers(last.x.data() + 3, last.x.data() + 6);
    const Eigen::Vector<double, 6> sigma = last.P.diagonal().cwiseSqrt();
    document.stddev["position_m"] = Numbers(sigma.data(), sigma.data() + 3);
    document.stddev["velocity_m_s"] = Numbers(sigma.data() + 3, sigma.data() + 6);
    document.covariance_names = {"x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"};
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) document.covariance_upper.push_back(last.P(i, j));
    }
  }
  add_track_tables(report.observations, report.rig.heads, report, report.truth, document);
  if (!report.innovations.empty()) document.data.push_back(innovations_table(report.rig.heads, report));
}

/// Adds what videos were searched for: `estimate.video`, a list of {head, frames, seen}, and the table `frames`.
void fill_target_frames(std::span<const TargetFrame> frames, std::span<const RigHead> heads, ResultDocument& document) {
  std::vector<std::size_t> num_frames(heads.size()), num_seen(heads.size());
  Numbers t, head, number, u, v, sigma, score;
  std::vector<std::string> reason;
  for (const TargetFrame& frame : frames) {
    ++num_frames[frame.head];
    num_seen[frame.head] += frame.seen.found() ? 1U : 0U;
  }
  for (const TargetFrame& frame : frames) {
    const auto if_found = [&](double value) { return frame.seen.found() ? value : missing_value; };
    t.push_back(frame.t_s);
    head.push_back(heads[frame.head].head.id);
    number.push_back(static_cast<double>(frame.number));
    u.push_back(if_found(frame.seen.px.x()));
    v.push_back(if_found(frame.seen.px.y()));
    sigma.push_back(if_found(std::sqrt(0.5 * frame.seen.cov.trace())));
    score.push_back(if_found(frame.seen.score));
    reason.push_back(frame.seen.reason);
  }
  JsonValue videos = JsonValue::list();
  for (std::size_t i = 0; i < heads.size(); ++i) {
    JsonValue video = JsonValue::object();
    video["head"] = heads[i].head.id;
    video["frames"] = num_frames[i];
    video["seen"] = num_seen[i];
    videos.push_back(std::move(video));
  }
  document.estimate["video"] = std::move(videos);
  DataTable table{"frames", {{"t_s", t}, {"head", head}, {"frame", number}}};
  table.columns.emplace_back("u_px", rounded(std::move(u), 4));
  table.columns.emplace_back("v_px", rounded(std::move(v), 4));
  table.columns.emplace_back("sigma_px", rounded(std::move(sigma), 4));
  table.columns.emplace_back("score", rounded(std::move(score), 4));
  table.columns.emplace_back("reason", reason);
  document.data.push_back(std::move(table));
}

void append_track_lines(const TargetTrack& report, std::vector<std::string>& lines) {
  if (report.steps.empty() || !report.steps.back().has_belief) return;
  const TrackStep& last = report.steps.back();
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    lines.push_back(fmt::format("{} {:9.4f} ± {:.2g} m, {:7.3f} ± {:.2g} m/s   (3σ, at {:.3f} s)",
                                axes[static_cast<std::size_t>(i)], last.belief.x[i],
                                3.0 * std::sqrt(last.belief.P(i, i)), last.belief.x[3 + i],
                                3.0 * std::sqrt(last.belief.P(3 + i, 3 + i)), last.t_s));
  }
  if (std::isfinite(report.nis_per_dof))
    lines.push_back(fmt::format("NIS per degree of freedom {:.2f}; the target's acceleration {:.2g} m/s² ({})",
                                report.nis_per_dof, report.sigma_a_m_s2,
                                report.sigma_a_is_found ? "estimated from the innovations" : "as given"));
  if (report.sigma_px_is_found)
    lines.push_back(fmt::format("σ of a pixel {:.2g} px (estimated from the innovations)", report.sigma_px));
  if (std::isfinite(report.rms_m))
    lines.push_back(fmt::format("against the truth: RMS {:.2f} mm, mean {:.2f} mm, NEES {:.2f}", 1e3 * report.rms_m,
                                1e3 * report.mean_error_m, report.nees_per_dof));
  if (std::isfinite(report.smoothed_rms_m))
    lines.push_back(fmt::format("smoothed: RMS {:.2f} mm", 1e3 * report.smoothed_rms_m));
  if (std::isfinite(report.pcrlb_m)) lines.push_back(fmt::format("bound (PCRLB) {:.2f} mm", 1e3 * report.pcrlb_m));
}

/// Adds all but what videos say.
void add_track(const TargetTrack& track, JobOutcome& outcome) {
  ResultDocument& document = outcome.document;
  document.verdict = track.verdict;
  document.counts = track.counts;
  document.assumed = track.assumed;
  fill_track(track, document);
  append_track_lines(track, outcome.lines);
  if (!is_estimate(static_cast<int>(track.verdict.exit_code))) return;
  outcome.files.push_back({"track.csv", track_csv(track.steps, track.ahead)});
  if (!track.smoothed.empty()) outcome.files.push_back({"smoothed.csv", smoothed_csv(track.smoothed)});
}

}  // namespace

JobOutcome outcome_of(const TargetTrack& track) {
  JobOutcome outcome;
  outcome.document.command = "track";
  add_track(track, outcome);
  return outcome;
}

JobOutcome outcome_of(const TargetTrack& track, const std::vector<TargetFrame>& frames) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "track";
  const std::vector<RigHead>& heads = track.rig.heads;
  fill_target_frames(frames, heads, document);
  outcome.lines.push_back(fmt::format("target seen in {} of {} frames", track.observations.size(), frames.size()));
  if (track.observations.empty()) {
    document.verdict = {State::refused,
                        ExitCode::undetermined,
                        "the target is in no frame of the videos",
                        "check --look against a frame, and that the target is in the image",
                        {}};
    return outcome;
  }
  outcome.files.push_back({"events.csv", events_csv(track.observations, heads)});
  add_track(track, outcome);
  return outcome;
}

}  // namespace alidade
