#include "alidade/results/track_document.h"

#include <array>
#include <cmath>
#include <limits>

#include "alidade/report/thin.h"
#include "alidade/results/thin_tables.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

constexpr std::array<const char*, 3> axes{"x", "y", "z"};
constexpr std::array<const char*, 6> cov_names{"xx", "xy", "xz", "yy", "yz", "zz"};
constexpr std::array<std::pair<int, int>, 6> cov_places{{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};

/// Which rows stand in the tables: evenly spread, and those with something to say.
std::vector<std::size_t> kept_rows(const TrackReport& report) {
  std::vector<bool> has_event;
  for (const TrackStep& step : report.steps) {
    has_event.push_back(step.event != TrackEvent::none && step.event != TrackEvent::one_head &&
                        step.event != TrackEvent::waiting);
  }
  return report::thinned_rows(report.steps.size(), {}, has_event, report::max_step_rows);
}

using ByAxis = std::array<Numbers, 3>;

void add_by_axis(DataTable& table, const std::string& before, const std::string& after, ByAxis values) {
  for (std::size_t k = 0; k < 3; ++k)
    table.columns.emplace_back(before + axes[k] + after, rounded(std::move(values[k]), 6));
}

DataTable steps_table(const TrackReport& report, const TrueTrack& truth, std::span<const std::size_t> rows) {
  Numbers t, nees;
  ByAxis target_in_world, velocity, sigma_in_world, sigma_velocity, true_position;
  std::array<Numbers, 6> cov;  // of the position, upper triangle
  std::vector<std::string> events;
  for (const std::size_t row : rows) {
    const TrackStep& step = report.steps[row];
    const auto there = truth.at(step.t_s);
    t.push_back(step.t_s);
    nees.push_back(row < report.nees.size() ? report.nees[row] : missing_value);
    events.emplace_back(event_name(step.event));
    for (int i = 0; i < 3; ++i) {
      const auto k = static_cast<std::size_t>(i);
      target_in_world[k].push_back(step.has_belief ? step.belief.x[i] : missing_value);
      velocity[k].push_back(step.has_belief ? step.belief.x[3 + i] : missing_value);
      sigma_in_world[k].push_back(step.has_belief ? std::sqrt(step.belief.P(i, i)) : missing_value);
      sigma_velocity[k].push_back(step.has_belief ? std::sqrt(step.belief.P(3 + i, 3 + i)) : missing_value);
      true_position[k].push_back(there ? (*there)[i] : missing_value);
    }
    for (std::size_t k = 0; k < cov.size(); ++k) {
      const auto [i, j] = cov_places[k];
      cov[k].push_back(step.has_belief ? step.belief.P(i, j) : missing_value);
    }
  }
  DataTable table{"steps", {{"t_s", t}}};
  add_by_axis(table, "target_in_world_", "_m", std::move(target_in_world));
  add_by_axis(table, "velocity_", "_m_s", std::move(velocity));
  add_by_axis(table, "sigma_target_in_world_", "_m", std::move(sigma_in_world));
  add_by_axis(table, "sigma_velocity_", "_m_s", std::move(sigma_velocity));
  for (std::size_t k = 0; k < cov.size(); ++k)
    table.columns.emplace_back(std::string("cov_") + cov_names[k] + "_m2", std::move(cov[k]));
  if (!truth.t_s.empty()) add_by_axis(table, "truth_", "_m", std::move(true_position));
  table.columns.emplace_back("nees", rounded(std::move(nees), 4));
  table.columns.emplace_back("event", events);
  return table;
}

DataTable measurements_table(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                             const TrackReport& report, std::span<const std::size_t> rows) {
  constexpr std::array<const char*, 12> names{"t_capture_s",
                                              "t_arrival_s",
                                              "pan_rad",
                                              "tilt_rad",
                                              "u_px",
                                              "v_px",
                                              "innovation_u_px",
                                              "innovation_v_px",
                                              "sigma_innovation_u_px",
                                              "sigma_innovation_v_px",
                                              "nis",
                                              "head"};
  std::array<Numbers, names.size()> column;
  ByAxis origin_in_world, direction_in_world;
  std::vector<bool> accepted;
  for (const std::size_t row : rows) {
    const TargetObservation& observation = observations[row];
    const TrackStep& step = report.steps[row];
    const Innovation& innovation = step.innovation;
    const auto if_there = [&](double value) { return step.has_innovation ? value : missing_value; };
    const std::array<double, names.size()> values{observation.t_capture_s,
                                                  observation.t_arrival_s,
                                                  observation.pan_tilt_rad.x(),
                                                  observation.pan_tilt_rad.y(),
                                                  observation.px.x(),
                                                  observation.px.y(),
                                                  if_there(innovation.nu.x()),
                                                  if_there(innovation.nu.y()),
                                                  if_there(std::sqrt(innovation.S(0, 0))),
                                                  if_there(std::sqrt(innovation.S(1, 1))),
                                                  if_there(innovation.nis),
                                                  static_cast<double>(heads[observation.head].head.id)};
    for (std::size_t k = 0; k < names.size(); ++k) column[k].push_back(values[k]);
    accepted.push_back(step.accepted);
    const auto ray = ray_in_world(heads[observation.head], observation);
    for (int i = 0; i < 3; ++i) {
      origin_in_world[static_cast<std::size_t>(i)].push_back(ray ? ray->origin_in_world[i] : missing_value);
      direction_in_world[static_cast<std::size_t>(i)].push_back(ray ? ray->direction_in_world[i] : missing_value);
    }
  }
  DataTable table{"measurements", {}};
  for (std::size_t k = 0; k < names.size(); ++k)
    table.columns.emplace_back(names[k], rounded(std::move(column[k]), k < 4 ? 6 : 4));
  table.columns.emplace_back("accepted", accepted);
  add_by_axis(table, "ray_origin_in_world_", "_m", std::move(origin_in_world));
  add_by_axis(table, "ray_direction_", "", std::move(direction_in_world));
  return table;
}

/// Of each head: how many, their mean, mean along the motion, slope over the image and colour, in σ of each.
DataTable innovations_table(std::span<const RigHead> heads, const TrackReport& report) {
  Numbers head, num, mean_u, mean_v, along, place_u, place_v, colour, nis;
  for (std::size_t h = 0; h < report.innovations.size(); ++h) {
    const HeadInnovations& of = report.innovations[h];
    head.push_back(heads[h].head.id);
    num.push_back(static_cast<double>(of.num));
    mean_u.push_back(of.mean.x());
    mean_v.push_back(of.mean.y());
    along.push_back(of.along);
    place_u.push_back(of.place.x());
    place_v.push_back(of.place.y());
    colour.push_back(of.colour);
    nis.push_back(of.nis_per_dof);
  }
  DataTable table{"innovations", {{"head", head}, {"num", num}}};
  table.columns.emplace_back("mean_u_sigma", rounded(std::move(mean_u), 4));
  table.columns.emplace_back("mean_v_sigma", rounded(std::move(mean_v), 4));
  table.columns.emplace_back("along_motion_sigma", rounded(std::move(along), 4));
  table.columns.emplace_back("slope_u_sigma", rounded(std::move(place_u), 4));
  table.columns.emplace_back("slope_v_sigma", rounded(std::move(place_v), 4));
  table.columns.emplace_back("colour", rounded(std::move(colour), 4));
  table.columns.emplace_back("nis_per_dof", rounded(std::move(nis), 4));
  return table;
}

}  // namespace

void fill_track(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                const TrackReport& report, const TrueTrack& truth, ResultDocument& document) {
  document.counts.given += observations.size();
  document.counts.used = report.num_used;
  document.counts.dropped = observations.size() - report.num_used;
  JsonValue& estimate = document.estimate;
  estimate["rms_m"] = report.rms_m;
  estimate["mean_error_m"] = report.mean_error_m;
  if (!report.smoothed.empty()) estimate["smoothed_rms_m"] = report.smoothed_rms_m;
  estimate["nees_per_dof"] = report.nees_per_dof;
  estimate["nis_per_dof"] = report.nis_per_dof;
  estimate["pcrlb_m"] = report.pcrlb_m;
  estimate["sigma_a_m_s2"] = report.sigma_a_m_s2;
  estimate["sigma_a_is_estimated"] = report.sigma_a_is_found;
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
  add_track_tables(observations, heads, report, truth, document);
  if (!report.innovations.empty()) document.data.push_back(innovations_table(heads, report));
}

void add_track_tables(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                      const TrackReport& report, const TrueTrack& truth, ResultDocument& document) {
  const std::vector<std::size_t> rows = kept_rows(report);
  document.data.push_back(steps_table(report, truth, rows));
  record_steps_kept(document.data.back(), report.steps.size(), "track.csv");
  document.data.push_back(measurements_table(observations, heads, report, rows));
  record_steps_kept(document.data.back(), report.steps.size(), "");
}

DataTable track_row(const TargetObservation& observation, std::span<const RigHead> heads, const TrackStep& step,
                    const TrueTrack& truth) {
  TrackReport report;
  report.steps = {step};
  report.nees = {position_nees(step, truth)};
  constexpr std::array<std::size_t, 1> row{0};
  DataTable table = steps_table(report, truth, row);
  DataTable observations = measurements_table({&observation, 1}, heads, report, row);
  for (auto& column : observations.columns) table.columns.push_back(std::move(column));
  return table;
}

void fill_target_frames(std::span<const TargetFrame> frames, std::span<const RigHead> heads, ResultDocument& document) {
  std::vector<std::size_t> num_frames(heads.size()), num_seen(heads.size());
  Numbers t, head, number, u, v, sigma, score;
  std::vector<std::string> reason;
  std::vector<bool> lost;
  for (const TargetFrame& frame : frames) {
    ++num_frames[frame.head];
    num_seen[frame.head] += frame.seen.found() ? 1U : 0U;
    lost.push_back(!frame.seen.found());
  }
  for (const std::size_t row : report::thinned_rows(frames.size(), {}, lost, report::max_step_rows)) {
    const TargetFrame& frame = frames[row];
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
  record_steps_kept(table, frames.size(), "");
  document.data.push_back(std::move(table));
}

}  // namespace alidade
