#include "alidade/results/documents/track_document.h"

#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "alidade/report/thin.h"
#include "alidade/results/documents/number_columns.h"
#include "alidade/results/thin_tables.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

constexpr std::array<const char*, 3> axes{"x", "y", "z"};
constexpr std::array<const char*, 6> cov_names{"xx", "xy", "xz", "yy", "yz", "zz"};
constexpr std::array<std::pair<int, int>, 6> cov_places{{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};

/// Which rows stand in the table of steps: track.csv has all.
std::vector<std::size_t> kept_rows(const TrackReport& report) {
  std::vector<bool> has_event;
  Numbers nis;
  for (const TrackStep& step : report.steps) {
    nis.push_back(step.has_innovation ? step.innovation.nis : missing_value);
    has_event.push_back(step.event != TrackEvent::none && step.event != TrackEvent::one_head &&
                        step.event != TrackEvent::waiting);
  }
  return report::thinned_rows(report.steps.size(), {nis}, has_event, report::max_step_rows);
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

NumberColumns measurement_columns() {
  return {{"t_capture_s", 6},
          {"t_arrival_s", 6},
          {"pan_rad", 6},
          {"tilt_rad", 6},
          {"u_px", 4},
          {"v_px", 4},
          {"innovation_u_px", 4},
          {"innovation_v_px", 4},
          {"sigma_innovation_u_px", 4},
          {"sigma_innovation_v_px", 4},
          {"nis", 4},
          {"head", 4}};
}

DataTable measurements_table(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                             const TrackReport& report, std::span<const std::size_t> rows) {
  NumberColumns columns = measurement_columns();
  ByAxis origin_in_world, direction_in_world;
  std::vector<bool> accepted;
  for (const std::size_t row : rows) {
    const TargetObservation& observation = observations[row];
    const TrackStep& step = report.steps[row];
    const Innovation& innovation = step.innovation;
    columns.add({observation.t_capture_s, observation.t_arrival_s, observation.pan_tilt_rad.x(),
                 observation.pan_tilt_rad.y(), observation.px.x(), observation.px.y()});
    if (step.has_innovation)
      columns.add({innovation.nu.x(), innovation.nu.y(), std::sqrt(innovation.S(0, 0)), std::sqrt(innovation.S(1, 1)),
                   innovation.nis});
    else
      columns.add_missing(5);
    columns.add({static_cast<double>(heads[observation.head].head.id)});
    accepted.push_back(step.accepted);
    const auto ray = ray_in_world(heads[observation.head], observation);
    for (int i = 0; i < 3; ++i) {
      origin_in_world[static_cast<std::size_t>(i)].push_back(ray ? ray->origin_in_world[i] : missing_value);
      direction_in_world[static_cast<std::size_t>(i)].push_back(ray ? ray->direction_in_world[i] : missing_value);
    }
  }
  DataTable table{"measurements", {}};
  columns.append_to(table);
  table.columns.emplace_back("accepted", accepted);
  add_by_axis(table, "ray_origin_in_world_", "_m", std::move(origin_in_world));
  add_by_axis(table, "ray_direction_", "", std::move(direction_in_world));
  return table;
}

}  // namespace

void add_track_tables(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                      const TrackReport& report, const TrueTrack& truth, ResultDocument& document) {
  const std::vector<std::size_t> rows = kept_rows(report);
  document.data.push_back(steps_table(report, truth, rows));
  record_steps_kept(document.data.back(), report.steps.size(), "nis", "track.csv");
  std::vector<std::size_t> all(report.steps.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  document.data.push_back(measurements_table(observations, heads, report, all));
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

}  // namespace alidade
