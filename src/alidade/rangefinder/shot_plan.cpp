#include "alidade/rangefinder/shot_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/board/board_reach.h"
#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

/// σ of the origin and the direction now.
double sigma_origin_m(const BeamNow& now) { return std::sqrt(now.beam.cov.topLeftCorner<3, 3>().trace()); }

double sigma_direction_rad(const BeamNow& now) {
  return std::sqrt(now.beam.cov.block<2, 2>(beam_direction_param, beam_direction_param).trace());
}

std::vector<std::string> shot_faults(const BeamNow& now, const ShotConfig& config) {
  ShotConfig copy = config;
  std::vector<std::string> found = faults_of(fields_of(copy));
  add_reach_fault(config.min_range_m, config.max_range_m, found);
  if (now.camera.width_px < 1 || now.camera.height_px < 1 || !params(now.camera.lens).allFinite())
    found.emplace_back("the camera is none");
  const bool is_beam = now.beam.origin_in_cam.allFinite() && now.beam.direction_in_cam.allFinite() &&
                       now.beam.direction_in_cam.norm() > 0.5 && now.beam.cov.allFinite();
  if (!is_beam) found.emplace_back("the beam is none");
  for (const double sigma_px : {now.sigma_spot_px, now.sigma_corner_px})
    if (!(sigma_px > 0.0) || !std::isfinite(sigma_px)) found.emplace_back("a sigma is not above 0");
  const auto is_finite = [](const Eigen::Vector3d& point) { return point.allFinite(); };
  if (!std::ranges::all_of(now.points_in_board, is_finite)) found.emplace_back("a point of the board is not finite");
  return found;
}

Verdict shots_verdict(const ShotPlan& plan, int wanted) {
  Verdict verdict;
  if (plan.shots.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    verdict.sentence = "no shot can be proposed: the beam hits no board inside the image at these distances";
    verdict.to_add = "widen --min-range-m and --max-range-m";
    return verdict;
  }
  if (static_cast<int>(plan.shots.size()) < wanted)
    verdict.to_add = fmt::format(
        "{} shot{} instead of {}: any other at these distances and tilts would repeat one of them, and be averaged "
        "with "
        "it; widen --min-range-m, --max-range-m and --max-tilt-deg for more",
        plan.shots.size(), plan.shots.size() == 1 ? "" : "s", wanted);
  verdict.sentence = fmt::format("{} more shot{} lower 3σ of the origin from {:.2g} to {:.2g} mm", plan.shots.size(),
                                 plan.shots.size() == 1 ? "" : "s", 3e3 * sigma_origin_m(plan.now),
                                 3e3 * plan.shots.back().sigma_origin_m);
  const NextShot& last = plan.shots.back();
  const double of_origin = last.sigma_origin_m / sigma_origin_m(plan.now);
  const double of_direction = last.sigma_direction_rad / sigma_direction_rad(plan.now);
  heed_gain(std::min(of_origin, of_direction), "widen --min-range-m, --max-range-m and --max-tilt-deg", verdict);
  return verdict;
}

/// That the next shots will be as those behind the beam.
std::vector<Assumption> assumed_of(const BeamNow& now) {
  std::vector<Assumption> assumed;
  const auto assume = [&](const char* what) { assumed.push_back({.name = what, .value = std::nan(""), .sigma = 0.0}); };
  if (!now.sees_spots) assume("no spot is seen, as in the shots given");
  if (!now.sees_boards) assume("no board is used, as in the shots given");
  return assumed;
}

/// What the shots behind the beam show. `have_corners`: boards were seen, not only given.
void put_taken(const RangefinderReport& report, bool have_corners, BeamNow& now) {
  bool any = false, spots = false, boards = false;
  for (const ShotFit& shot : report.shots) {
    if (!shot.used) continue;
    const bool has_spot = shot.residual_px.allFinite();
    any = true;
    spots = spots || has_spot;
    boards = boards || shot.plane || shot.pose;
    const Eigen::Vector3d along = shot.point_in_cam - report.beam.origin_in_cam;
    const double range_m = along.dot(report.beam.direction_in_cam) / report.beam.scale;
    if (shot.pose && have_corners) now.taken.push_back({range_m, shot.pose->cam_from_board, has_spot});
  }
  now.sees_spots = spots || !any;
  now.sees_boards = boards || !any;
}

}  // namespace

FieldList fields_of(ShotConfig& config) {
  FieldList fields{{.name = "shots", .value = &config.shots, .help = "Number of shots to propose", .limits = {1, 20}}};
  for (Field& field : board_reach_fields(config.min_range_m, config.max_range_m, "max_tilt_deg", config.max_tilt_deg))
    fields.push_back(std::move(field));
  return fields;
}

ShotPlan plan_shots(const BeamNow& now, const ShotConfig& config, const Progress& progress) {
  if (const auto faults = shot_faults(now, config); !faults.empty())
    throw ConfigError(fmt::format("{}", fmt::join(faults, "; ")));
  const ShotLimits limits{config.min_range_m, config.max_range_m, config.max_tilt_deg * degree};
  ShotPlan plan;
  plan.now = now;
  plan.shots = plan_next_shots(now, limits, config.shots, progress);
  plan.counts.given = plan.counts.used = 1;
  plan.assumed = assumed_of(now);
  plan.verdict = shots_verdict(plan, config.shots);
  return plan;
}

BeamNow beam_now(const RangefinderReport& report, const RangefinderConfig& config) {
  BeamNow now{.beam = report.beam, .camera = report.camera, .points_in_board = {}};
  now.method = config.method;
  now.refine = config.refine;
  now.estimate_scale = config.estimate_scale;
  now.sheet = report.sheet;
  if (report.sigma_spot_px > 0.0) now.sigma_spot_px = report.sigma_spot_px;
  if (report.sigma_corner_px > 0.0) now.sigma_corner_px = report.sigma_corner_px;
  put_taken(report, config.board.has_value(), now);
  now.points_in_board = points_in_board(config.board.value_or(Board{.cols = 9, .rows = 6, .square_m = 0.04}));
  return now;
}

}  // namespace alidade
