#include "alidade/results/shots_outcome.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>

#include "alidade/files/number_list.h"
#include "alidade/formats/camera_json.h"
#include "alidade/geometry/degree.h"
#include "alidade/results/documents/calibration_document.h"
#include "alidade/results/documents/number_columns.h"

namespace alidade {
namespace {

DataTable planned_shots_table(const std::vector<NextShot>& shots) {
  NumberColumns columns{{"distance_m"},          {"tilt_rad"},     {"azimuth_rad"}, {"sigma_origin_m"},
                        {"sigma_direction_rad"}, {"spot_sigma_px"}};
  columns.with_pose("cam_from_board");
  for (const NextShot& shot : shots) {
    columns.add({shot.distance_m, shot.tilt_rad, shot.azimuth_rad, shot.sigma_origin_m, shot.sigma_direction_rad,
                 shot.spot_sigma_px});
    columns.add_pose(&shot.cam_from_board);
  }
  DataTable table{"next", {}};
  columns.append_to(table);
  return table;
}

/// Which side of the board is farther away.
std::string_view far_side(double azimuth_rad) {
  static const std::array<std::string_view, 8> sides{"right", "lower right", "lower", "lower left",
                                                     "left",  "upper left",  "upper", "upper right"};
  const auto eighth = static_cast<long>(std::lround(azimuth_rad / (0.25 * std::numbers::pi)));
  return sides[static_cast<std::size_t>(((eighth % 8) + 8) % 8)];
}

std::string shot_line(const NextShot& shot, std::size_t number) {
  const std::string tilted = shot.tilt_rad < 0.01 ? "facing the camera"
                                                  : fmt::format("tilted by {:.0f}°, {} side away",
                                                                shot.tilt_rad / degree, far_side(shot.azimuth_rad));
  return fmt::format(
      "shot {}: board at {:.2f} m, {}: 3σ of the origin {:.2g} mm, of the direction {:.2g} mrad, of the spot {:.2g} px "
      "at worst",
      number, shot.distance_m, tilted, 3e3 * shot.sigma_origin_m, 3e3 * shot.sigma_direction_rad,
      3.0 * shot.spot_sigma_px);
}

}  // namespace

JobOutcome outcome_of(const ShotPlan& plan) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "plan rangefinder";
  document.counts = plan.counts;
  document.assumed = plan.assumed;
  document.verdict = plan.verdict;
  if (plan.shots.empty()) return outcome;
  for (std::size_t i = 0; i < plan.shots.size(); ++i) outcome.lines.push_back(shot_line(plan.shots[i], i + 1));
  for (const Assumption& assumed : plan.assumed) outcome.lines.push_back("assumed: " + assumed.name);
  const Beam& beam = plan.now.beam;
  document.data.push_back(planned_shots_table(plan.shots));
  document.data.push_back(points_in_board_table(plan.now.points_in_board));
  document.estimate["camera"] = camera_values(plan.now.camera);
  document.estimate["origin_m"] = list_of(beam.origin_in_cam);
  document.estimate["direction"] = list_of(beam.direction_in_cam);
  document.estimate["sigma_now_origin_m"] = std::sqrt(beam.cov.topLeftCorner<3, 3>().trace());
  document.estimate["sigma_now_direction_rad"] = std::sqrt(beam.cov.block<2, 2>(3, 3).trace());
  document.estimate["sigma_planned_origin_m"] = plan.shots.back().sigma_origin_m;
  document.estimate["sigma_planned_direction_rad"] = plan.shots.back().sigma_direction_rad;
  return outcome;
}

}  // namespace alidade
