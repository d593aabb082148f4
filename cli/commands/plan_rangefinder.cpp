#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "alidade/files/number_list.h"
#include "alidade/formats/camera_json.h"
#include "alidade/geometry/degree.h"
#include "alidade/results/calibration_document.h"
#include "alidade/results/rangefinder_result.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct PlanRangefinderArgs {
  std::filesystem::path result;
  int shots = 3;
  double max_tilt_deg = 45.0;
  ShotLimits limits;
};

DataTable shots_table(const std::vector<NextShot>& shots) {
  std::vector<std::vector<double>> columns(13);
  for (const NextShot& shot : shots) {
    const Eigen::Vector3d& t = shot.cam_from_board.translation;
    const Eigen::Quaterniond& q = shot.cam_from_board.rotation;
    const std::array<double, 13> values{shot.distance_m,
                                        shot.tilt_rad,
                                        shot.azimuth_rad,
                                        shot.sigma_origin_m,
                                        shot.sigma_direction_rad,
                                        shot.spot_sigma_px,
                                        t.x(),
                                        t.y(),
                                        t.z(),
                                        q.x(),
                                        q.y(),
                                        q.z(),
                                        q.w()};
    for (std::size_t i = 0; i < values.size(); ++i) columns[i].push_back(values[i]);
  }
  static const std::array<const char*, 13> names{
      "distance_m",        "tilt_rad",           "azimuth_rad",        "sigma_origin_m",     "sigma_direction_rad",
      "spot_sigma_px",     "cam_from_board_x_m", "cam_from_board_y_m", "cam_from_board_z_m", "cam_from_board_qx",
      "cam_from_board_qy", "cam_from_board_qz",  "cam_from_board_qw"};
  DataTable table{"next", {}};
  for (std::size_t i = 0; i < names.size(); ++i) table.columns.emplace_back(names[i], columns[i]);
  return table;
}

/// Which side of the board is farther away.
std::string_view far_side(double azimuth_rad) {
  static const std::array<std::string_view, 8> sides{"right", "lower right", "lower", "lower left",
                                                     "left",  "upper left",  "upper", "upper right"};
  const auto eighth = static_cast<long>(std::lround(azimuth_rad / (0.25 * std::numbers::pi)));
  return sides[static_cast<std::size_t>(((eighth % 8) + 8) % 8)];
}

ExitCode plan_rangefinder(const PlanRangefinderArgs& args, Run& run) {
  ShotLimits limits = args.limits;
  limits.max_tilt_rad = args.max_tilt_deg * degree;
  if (!(limits.min_range_m < limits.max_range_m)) throw UsageError("--min-range-m must be below --max-range-m");
  const bool is_folder = std::filesystem::is_directory(args.result);
  run.add_input("result", is_folder ? args.result / "result.json" : args.result);
  const BeamNow now = read_rangefinder(args.result);
  const std::vector<NextShot> shots = plan_next_shots(now, limits, args.shots, run.progress);
  run.document.counts.given = run.document.counts.used = 1;
  Verdict verdict;
  if (shots.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::cannot_tell;
    verdict.sentence = "no shot can be proposed: the beam hits no board inside the picture at these distances";
    verdict.to_add = "widen --min-range-m and --max-range-m";
    return run.finish(verdict);
  }
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const NextShot& shot = shots[i];
    const std::string tilted = shot.tilt_rad < 0.01 ? "facing the camera"
                                                    : fmt::format("tilted by {:.0f}°, {} side away",
                                                                  shot.tilt_rad / degree, far_side(shot.azimuth_rad));
    run.say(
        fmt::format("shot {}: board at {:.2f} m, {}: 3σ of the origin {:.2g} mm, of the direction {:.2g} mrad, of "
                    "the spot {:.2g} px at worst",
                    i + 1, shot.distance_m, tilted, 3e3 * shot.sigma_origin_m, 3e3 * shot.sigma_direction_rad,
                    3.0 * shot.spot_sigma_px));
  }
  run.document.data.push_back(shots_table(shots));
  run.document.data.push_back(points_in_board_table(now.points_in_board));
  run.document.estimate["camera"] = camera_values(now.camera);
  run.document.estimate["origin_m"] = list_of(now.beam.origin_in_cam);
  run.document.estimate["direction"] = list_of(now.beam.direction_in_cam);
  const double sigma_now_m = std::sqrt(now.beam.cov.topLeftCorner<3, 3>().trace());
  run.document.estimate["sigma_now_origin_m"] = sigma_now_m;
  run.document.estimate["sigma_now_direction_rad"] = std::sqrt(now.beam.cov.block<2, 2>(3, 3).trace());
  run.document.estimate["sigma_planned_origin_m"] = shots.back().sigma_origin_m;
  run.document.estimate["sigma_planned_direction_rad"] = shots.back().sigma_direction_rad;
  verdict.sentence = fmt::format("{} more shot{} lower 3σ of the origin from {:.2g} to {:.2g} mm", shots.size(),
                                 shots.size() == 1 ? "" : "s", 3e3 * sigma_now_m, 3e3 * shots.back().sigma_origin_m);
  return run.finish(verdict);
}

}  // namespace

void add_plan_rangefinder(App& app) {
  auto args = std::make_shared<PlanRangefinderArgs>();
  CLI::App& command =
      app.add_command({.name = "plan rangefinder",
                       .summary = "Where to hold the board for the shots that lower the uncertainty most",
                       .examples = "alidade plan rangefinder alidade-out/rangefinder --shots 3\n"},
                      [args](Run& run) { return plan_rangefinder(*args, run); });
  command.add_option("result", args->result, "Folder or result.json of a calibrated rangefinder")->required();
  command.add_option("--shots", args->shots, "How many shots to propose")
      ->check(CLI::Range(1, 20))
      ->capture_default_str();
  command.add_option("--min-range-m", args->limits.min_range_m, "Nearest board")
      ->check(positive_number())
      ->capture_default_str();
  command.add_option("--max-range-m", args->limits.max_range_m, "Farthest board")
      ->check(positive_number())
      ->capture_default_str();
  command.add_option("--max-tilt-deg", args->max_tilt_deg, "Largest tilt of the board [deg]")
      ->check(CLI::Range(0.0, 80.0))
      ->capture_default_str();
}

}  // namespace alidade::cli
