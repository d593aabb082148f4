#include "alidade/tables/events_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "alidade/files/table_rows.h"
#include "alidade/tables/logs/events_stream.h"

namespace alidade {
namespace {

std::string cells_of(const Belief<6>& belief) {
  std::string cells;
  for (int i = 0; i < 6; ++i) cells += fmt::format(",{:.6f}", belief.x[i]);
  for (int i = 0; i < 3; ++i) cells += fmt::format(",{:.6g}", std::sqrt(belief.P(i, i)));
  return cells;
}

}  // namespace

std::vector<int> heads_in_events(const std::filesystem::path& file, bool skip_bad) {
  const Csv csv = Csv::read(file, skip_bad);
  if (!csv.has("head")) throw InputError(csv.name() + ": has no column 'head'");
  std::set<int> ids;
  std::vector<SkippedInput> named_later;
  for_each_row(csv, skip_bad, named_later,
               [&](std::size_t row) { ids.insert(static_cast<int>(csv.integer(row, "head", 0, 1000000))); });
  return {ids.begin(), ids.end()};
}

EventsFile read_events(const std::filesystem::path& file, std::span<const RigHead> heads,
                       const EventsOptions& options) {
  const Csv csv = Csv::read(file, options.skip_bad);
  EventRows rows(csv, heads, options.stands_still);
  EventsFile read;
  for_each_row(csv, options.skip_bad, read.skipped,
               [&](std::size_t row) { read.observations.push_back(rows.read(csv, row)); });
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
