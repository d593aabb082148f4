#include "alidade/heads/calibration/calibration_log.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "alidade/files/files.h"
#include "alidade/observe.h"
#include "alidade/tables/rotation_log_file.h"

namespace alidade {
namespace {

ObserveConfig offline_config(const HeadCalibration& result) {
  ObserveConfig config;
  config.no_zoom = true;
  config.method = ObserveMethod::batch;  // nothing changes: a filter that follows would only lose rows
  config.width_px = result.width_px;
  config.height_px = result.height_px;
  config.square_pixels = config.fixed_centre = result.narrow_focal_px > 0.0;
  if (!config.square_pixels) config.estimate.emplace_back("k1");
  config.estimate.emplace_back("mount");
  if (!result.is_of_shots) config.estimate.emplace_back("delay");  // what stands shows none
  if (result.sigma_angle_rad > 0.0) {
    config.rotation = RotationKnowledge::noisy;
    config.sigma_angle_rad = result.sigma_angle_rad;
  }
  if (const double f = result.narrow_focal_px; f > 0.0)
    config.start = Eigen::Vector4d(f, f, 0.5 * (result.width_px - 1), 0.5 * (result.height_px - 1));
  return config;
}

}  // namespace

bool is_narrow(const HeadCalibration& result, double focal_px) {
  constexpr double narrow_rad = 0.1;
  return std::max(result.width_px, result.height_px) < narrow_rad * focal_px;
}

ObserveReport observed(const HeadCalibration& result) {
  try {
    return observe(parse_rotation_log(result.log_csv, "log.csv").log, offline_config(result));
  } catch (const InputError& error) {  // no rows, or no points
    ObserveReport report;
    report.verdict.state = State::refused;
    report.verdict.exit_code = ExitCode::undetermined;
    const bool has_points = result.has_seen_points;
    report.verdict.sentence =
        has_points ? fmt::format(
                         "points were followed, but never where the head is known to stand or to move evenly; "
                         "its answers take {:.2g} ms",
                         1e3 * result.answer_s)
                   : std::string("no point was followed while the head moved evenly: ") + error.what();
    report.verdict.to_add = has_points ? "look whether its readings are those of its position, and answer sooner"
                                       : "let the camera see corners or texture, sharply";
    return report;
  }
}

void heed_noise_of_readings(HeadCalibration& result) {
  const double noise_rad = result.report.shared_errors.rotation_rad;
  if (result.is_of_shots || !(noise_rad > 0.0)) return;
  result.sigma_angle_rad = noise_rad;
  ObserveReport report = observed(result);
  const bool is_answer = report.status == ObserveReport::Status::ok;
  if (is_answer && report.quantities.front().sigma <= result.report.quantities.front().sigma)
    result.report = std::move(report);
  else
    result.sigma_angle_rad = 0.0;
}

std::vector<std::string> offline_words(const HeadCalibration& result) {
  const ObserveConfig config = offline_config(result);
  std::vector<std::string> words{"observe",    "log.csv",
                                 "--size",     fmt::format("{}x{}", config.width_px, config.height_px),
                                 "--estimate", fmt::format("{}", fmt::join(config.estimate, ",")),
                                 "--no-zoom",  "--method",
                                 "batch"};
  if (config.sigma_angle_rad)
    words.insert(words.end(), {"--rotation", "noisy", "--sigma-angle", fmt::format("{}", *config.sigma_angle_rad)});
  if (config.square_pixels) words.insert(words.end(), {"--square-pixels", "--fix-centre"});
  if (config.start)
    words.insert(words.end(), {"--start", fmt::format("{},{},{},{}", (*config.start)[0], (*config.start)[1],
                                                      (*config.start)[2], (*config.start)[3])});
  return words;
}

RotationLog joined_logs(const RotationLog& before, const RotationLog& now) {
  constexpr double pause_s = 60.0;
  RotationLog both = before;
  both.num_points = before.num_points + now.num_points;
  const double begin_s = before.rows.empty() ? 0.0 : std::ceil(before.rows.back().t_s + pause_s);
  for (RotationRow& row : both.rows) row.px.resize(both.num_points, Eigen::Vector2d::Constant(not_seen));
  for (RotationRow row : now.rows) {
    row.t_s += begin_s - now.rows.front().t_s;
    row.px.insert(row.px.begin(), before.num_points, Eigen::Vector2d::Constant(not_seen));
    both.rows.push_back(std::move(row));
  }
  return both;
}

}  // namespace alidade
