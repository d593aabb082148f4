#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/reproduce/beam_trials.h"
#include "alidade/reproduce/edge_scene.h"
#include "alidade/reproduce/wang_experiments.h"

namespace alidade::reproduce {
namespace {

/// One row of the table.
struct Row {
  Beam beam;
  std::vector<double> angles_mrad = {};  ///< Errors of both angles over all logs.
  double direction_mrad = 0.0, time_ms = not_a_number;
};

double now_s(const ReproduceConfig& config) { return config.clock_s ? config.clock_s() : not_a_number; }

/// Median time of one solve, and the beam and the median direction error over some logs.
Row solved_row(const ReproduceConfig& config, RangefinderMethod method) {
  Row row;
  std::vector<double> times, directions;
  const RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  for (int trial = 0; trial < (config.quick ? 41 : 201); ++trial) {
    report_progress(config.progress, "table 2", static_cast<std::size_t>(trial), config.quick ? 41 : 201);
    const auto sample = draw_rangefinder_sample(scene, {}, 500000 * config.seed + static_cast<std::uint64_t>(trial));
    const double before_s = now_s(config);
    const RangefinderReport report = solve_sample(sample, told_config(method));
    times.push_back(1e3 * (now_s(config) - before_s));
    directions.push_back(1e3 * direction_error_rad(report, sample).norm());
    const Eigen::Vector2d off = direction_angles_rad(report.beam) - direction_angles_rad(scene.beam);
    for (const double angle : off) row.angles_mrad.push_back(1e3 * std::abs(angle));
    if (trial == 0) row.beam = report.beam;
  }
  row.direction_mrad = quantile_of(directions, 0.5);
  if (config.clock_s) row.time_ms = quantile_of(times, 0.5);
  return row;
}

/// The existing algorithm: edges of a scan on edges of a photo. Its room has a beam of its own.
Row edges_row(const ReproduceConfig& config) {
  const Camera camera = edge_camera();
  Beam truth;
  truth.origin_in_cam = {0.04, -0.05, 0.0};
  truth.direction_in_cam = Eigen::Vector3d(0.03, -0.025, 1.0).normalized();
  const std::vector<ScanRow> scan = scan_of(truth, config.quick ? 0.0088 : 0.0044);
  const GreyImage photo = photo_of(camera);
  const double before_s = now_s(config);
  const EdgesReport report = align_edges(scan, photo, camera, Beam{}, {.blur_px = {12.0, 6.0, 3.0}}, config.progress);
  const double after_s = now_s(config);
  return {report.beam,
          {},
          1e3 * (report.beam.direction_in_cam - truth.direction_in_cam).norm(),
          1e3 * (after_s - before_s)};
}

FigureTable table_of(const std::array<Row, 4>& rows) {
  FigureTable figure{"table_2",
                     {{"algorithm", {1, 2, 3, 4}},
                      {"printed_theta_x_rad", {1.557, not_a_number, not_a_number, not_a_number}},
                      {"ours_theta_x_rad", {}},
                      {"printed_theta_y_rad", {1.586, not_a_number, not_a_number, not_a_number}},
                      {"ours_theta_y_rad", {}},
                      {"ours_x_m", {}},
                      {"ours_y_m", {}},
                      {"ours_z_m", {}},
                      {"printed_time_ms", {63, 106, 153, not_a_number}},
                      {"ours_time_ms", {}}}};
  for (const Row& row : rows) {
    const Eigen::Vector2d theta = direction_angles_rad(row.beam);
    const std::array<double, 6> values{
        theta.x(),  theta.y(), row.beam.origin_in_cam.x(), row.beam.origin_in_cam.y(), row.beam.origin_in_cam.z(),
        row.time_ms};
    constexpr std::array<std::size_t, 6> columns{2, 4, 5, 6, 7, 9};
    for (std::size_t i = 0; i < 6; ++i) figure.columns[columns[i]].second.push_back(values[i]);
  }
  return figure;
}

Claim speed_claim(const std::string& id, const std::string& method, double printed, const Row& ours,
                  const Row& existing, const Row& best) {
  Claim claim{id,
              method + " is faster than the existing algorithm, times",
              "",
              printed,
              existing.time_ms / ours.time_ms,
              existing.time_ms / best.time_ms};
  claim.holds = claim.rerun >= printed ? Holds::reproduced
                : claim.rerun > 1.0    ? Holds::in_shape
                                       : Holds::not_reproducible;
  claim.words = fmt::format(
      "Here {:.1f} ms beside {:.0f} ms, on another machine than the paper's. Its 153 ms cannot include "
      "the scan of thousands of readings that the existing algorithm needs.",
      ours.time_ms, existing.time_ms);
  claim.figure = "table_2";
  return claim;
}

}  // namespace

Experiment wang_table_2(const ReproduceConfig& config) {
  const Row spot = solved_row(config, RangefinderMethod::spot), plane = solved_row(config, RangefinderMethod::plane),
            joint = solved_row(config, RangefinderMethod::joint), edges = edges_row(config);
  Claim values{"table2-angles",
               "angles of the beam by method 1, to the 1 mrad that Table 2 prints",
               "mrad",
               1.0,
               quantile_of(spot.angles_mrad, 0.5),
               quantile_of(joint.angles_mrad, 0.5)};
  values.holds = at_most(spot.angles_mrad, 1.0);
  values.words =
      "Median error of either angle over logs of 18 shots of a beam with the paper's angles and origin; its camera's "
      "principal point, known to 2 px, is what limits it. Readings 2 mm, spots 0.3 px, corners 0.2 px.";
  values.figure = "table_2";
  Claim existing{"table2-existing",
                 "the existing algorithm finds the direction, from a start that is 39 mrad off",
                 "mrad",
                 not_a_number,
                 edges.direction_mrad,
                 joint.direction_mrad};
  existing.holds = edges.direction_mrad < 0.5 * 39.0 ? Holds::reproduced : Holds::not_reproducible;
  existing.words = "A legitimate direction to some mrad without a target; its origin is told to centimetres only.";
  existing.figure = "table_2";
  Experiment experiment{"table2", "Table 2: three algorithms",
                        "Rows: 1 method 1 (spots), 2 method 2 (planes), both with global optimisation, 3 the existing "
                        "algorithm (edges of a scan on the edges of a photo), 4 ours (both kinds of measurement "
                        "together). 18 boards of 9×6 corners between 0.5 and 4 m, tilted up to 45°; the beam has the "
                        "angles 1.557 and 1.586 and the origin (40, -70, 40) mm. The existing algorithm looks at a "
                        "room of its own, six boxes before a wall, with 320×240 px.",
                        "Noise, boards and room are ours. The table's t is taken to be in metres."};
  experiment.claims = {values, existing};
  if (config.clock_s) {
    experiment.claims.push_back(speed_claim("table2-faster-1", "method 1", 153.0 / 63.0, spot, edges, joint));
    experiment.claims.push_back(speed_claim("table2-faster-2", "method 2", 153.0 / 106.0, plane, edges, joint));
  }
  experiment.figures = {table_of({spot, plane, edges, joint})};
  return experiment;
}

}  // namespace alidade::reproduce
