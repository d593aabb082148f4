#include "alidade/tables/events_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "alidade/files/table_rows.h"
#include "alidade/tables/logs/head_column.h"

namespace alidade {
namespace {

struct EventColumns {
  std::string pan, tilt, u, v;
  bool has_arrival = false, from_centre = false;
};

std::string either(const Csv& csv, const std::string& first, const std::string& second, const std::string& hint = "") {
  if (csv.has(first)) return first;
  if (csv.has(second)) return second;
  csv.refuse_missing(first, hint);
}

EventColumns event_columns_of(const Csv& csv, bool stands_still) {
  csv.require(std::vector<std::string>{"t_capture_s", "head"});
  const std::string hint = csv.has("pan_deg") || csv.has("tilt_deg") ? "; angles are radians" : "";
  const bool has_angles = !stands_still || !hint.empty() || csv.has("pan_rad") || csv.has("tilt_rad");
  EventColumns columns{has_angles ? either(csv, "pan_rad", "pan_rad_at_capture", hint) : "",
                       has_angles ? either(csv, "tilt_rad", "tilt_rad_at_capture", hint) : "",
                       "",
                       "",
                       csv.has("t_arrival_s"),
                       !csv.has("u_px") && csv.has("du_px")};
  columns.u = columns.from_centre ? "du_px" : "u_px";
  columns.v = columns.from_centre ? "dv_px" : "v_px";
  csv.require(std::vector<std::string>{columns.u, columns.v});
  return columns;
}

Eigen::Vector2d principal_point(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);  // fx, fy, cx, cy, skew come first in every model
  return {values[2], values[3]};
}

/// `newest_s`: arrival of the newest row so far; of one clock for all heads, or one for each.
TargetObservation read_row(const Csv& csv, std::size_t row, const EventColumns& columns, std::span<const RigHead> heads,
                           std::span<const double> newest_s) {
  TargetObservation observation;
  observation.head = head_in_row(csv, row, heads);
  observation.t_capture_s = csv.number(row, "t_capture_s");
  observation.t_arrival_s = columns.has_arrival ? csv.number(row, "t_arrival_s") : observation.t_capture_s;
  const std::string clock = columns.has_arrival ? "t_arrival_s" : "t_capture_s";
  if (!(observation.t_arrival_s >= observation.t_capture_s))
    throw InputError(csv.where(row, "t_arrival_s") + ": arrives before its capture");
  if (!(observation.t_arrival_s >= newest_s[newest_s.size() > 1 ? observation.head : 0]))
    throw InputError(csv.where(row, clock) + ": '" + csv.text(row, clock) +
                     "' runs backwards; rows stand in order of arrival");
  constexpr double max_px = 1e6;
  if (!columns.pan.empty())
    observation.pan_tilt_rad = {angle_in_row(csv, row, columns.pan), angle_in_row(csv, row, columns.tilt)};
  observation.px = {csv.number(row, columns.u), csv.number(row, columns.v)};
  if (!(observation.px.cwiseAbs().maxCoeff() < max_px))
    throw InputError(csv.where(row, columns.u) + ": is in no image");
  if (csv.has("sigma_px") && !csv.is_empty(row, "sigma_px")) observation.sigma_px = csv.positive(row, "sigma_px");
  if (columns.from_centre) observation.px += principal_point(heads[observation.head].camera);
  return observation;
}

std::string cells_of(const Belief<6>& belief) {
  std::string cells;
  for (int i = 0; i < 6; ++i) cells += fmt::format(",{:.6f}", belief.x[i]);
  for (int i = 0; i < 3; ++i) cells += fmt::format(",{:.6g}", std::sqrt(belief.P(i, i)));
  return cells;
}

}  // namespace

std::vector<int> heads_in_events(const std::filesystem::path& file) {
  const Csv csv = Csv::read(file);
  if (!csv.has("head")) throw InputError(csv.name() + ": has no column 'head'");
  std::set<int> ids;
  for (std::size_t row = 0; row < csv.num_rows(); ++row)
    ids.insert(static_cast<int>(csv.integer(row, "head", 0, 1000000)));
  return {ids.begin(), ids.end()};
}

EventsFile read_events(const std::filesystem::path& file, std::span<const RigHead> heads,
                       const EventsOptions& options) {
  const Csv csv = Csv::read(file);
  const EventColumns columns = event_columns_of(csv, options.stands_still);
  EventsFile read;
  std::vector<double> newest_s(options.stands_still ? heads.size() : 1, -1e300);
  std::vector<std::optional<Eigen::Vector2d>> first_rad(heads.size());
  std::set<std::pair<std::size_t, double>> seen;
  for_each_row(csv, options.skip_bad, read.skipped, [&](std::size_t row) {
    const TargetObservation observation = read_row(csv, row, columns, heads, newest_s);
    if (!seen.emplace(observation.head, observation.t_capture_s).second)
      throw InputError(csv.where(row, "t_capture_s") + ": '" + csv.text(row, "t_capture_s") +
                       "' stands in a row of this head before; an image has one target");
    const Eigen::Vector2d& stood_rad =
        *(first_rad[observation.head] ? first_rad[observation.head]
                                      : first_rad[observation.head] = observation.pan_tilt_rad);
    constexpr double still_rad = 1e-6;
    if (options.stands_still && (observation.pan_tilt_rad - stood_rad).cwiseAbs().maxCoeff() > still_rad)
      throw InputError(csv.where(row, columns.pan) + ": the head turns; this is for cameras that stand still");
    newest_s[options.stands_still ? observation.head : 0] = observation.t_arrival_s;
    read.observations.push_back(observation);
  });
  if (read.observations.empty()) throw InputError(file.string() + ": has no events; at least one row is needed");
  return read;
}

std::string events_csv(std::span<const TargetObservation> observations, std::span<const RigHead> heads) {
  const bool has_sigma = std::ranges::any_of(
      observations, [](const TargetObservation& observation) { return observation.sigma_px > 0.0; });
  std::string text = "t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px";
  text += has_sigma ? ",sigma_px\n" : "\n";
  for (const TargetObservation& observation : observations) {
    text += fmt::format("{:.6f},{:.6f},{},{:.9f},{:.9f},{:.4f},{:.4f}", observation.t_capture_s,
                        observation.t_arrival_s, heads[observation.head].head.id, observation.pan_tilt_rad.x(),
                        observation.pan_tilt_rad.y(), observation.px.x(), observation.px.y());
    if (has_sigma) text += observation.sigma_px > 0.0 ? fmt::format(",{:.4f}", observation.sigma_px) : ",";
    text += "\n";
  }
  return text;
}

TrueTrack read_true_track(const std::filesystem::path& file) {
  const Csv csv = Csv::read(file);
  TrueTrack truth;
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const double t_s = csv.number(row, "t_s");
    if (!truth.t_s.empty() && !(t_s > truth.t_s.back()))
      throw InputError(csv.where(row, "t_s") + ": '" + csv.text(row, "t_s") + "' is not after the row before it");
    truth.t_s.push_back(t_s);
    truth.position.emplace_back(csv.number(row, "x_m"), csv.number(row, "y_m"), csv.number(row, "z_m"));
  }
  if (truth.t_s.empty()) throw InputError(file.string() + ": has no rows");
  return truth;
}

std::string true_track_csv(const TrueTrack& truth) {
  std::string text = "t_s,x_m,y_m,z_m\n";
  for (std::size_t i = 0; i < truth.t_s.size(); ++i) {
    const Eigen::Vector3d& p = truth.position[i];
    text += fmt::format("{:.6f},{:.7f},{:.7f},{:.7f}\n", truth.t_s[i], p.x(), p.y(), p.z());
  }
  return text;
}

std::string track_csv(std::span<const TrackStep> steps, std::span<const PredictedStep> ahead) {
  std::string text = "t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,sigma_x_m,sigma_y_m,sigma_z_m,nis,event\n";
  const std::string no_belief(9, ',');
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const TrackStep& step = steps[i];
    text += fmt::format("{:.6f}", step.t_s) + (step.has_belief ? cells_of(step.belief) : no_belief);
    text += step.has_innovation ? fmt::format(",{:.4f},", step.innovation.nis) : ",,";
    text += std::string(event_name(step.event)) + "\n";
    if (i < ahead.size() && ahead[i].has_belief)
      text += fmt::format("{:.6f}", ahead[i].t_s) + cells_of(ahead[i].belief) + ",,predicted\n";
  }
  return text;
}

std::string smoothed_csv(std::span<const PredictedStep> smoothed) {
  std::string text = "t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,sigma_x_m,sigma_y_m,sigma_z_m\n";
  for (const PredictedStep& step : smoothed) text += fmt::format("{:.6f}", step.t_s) + cells_of(step.belief) + "\n";
  return text;
}

}  // namespace alidade
