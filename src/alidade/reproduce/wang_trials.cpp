#include "alidade/reproduce/wang_trials.h"

#include <algorithm>
#include <cmath>

namespace alidade::reproduce {
namespace {

constexpr double sigma_range_m = 0.001, corner_px = 0.1;

struct Way {
  RangefinderMethod method;
  Refine refine;
};
constexpr std::array<Way, num_ways> ways{{{RangefinderMethod::spot, Refine::beam},
                                          {RangefinderMethod::spot, Refine::all},
                                          {RangefinderMethod::plane, Refine::beam},
                                          {RangefinderMethod::plane, Refine::all},
                                          {RangefinderMethod::joint, Refine::all}}};

int num_logs(const ReproduceConfig& config, std::size_t n) {
  const int usual = config.quick ? 20 : 200;
  return n == at_14 || n == at_15 || n == at_18 || n == at_30 ? 3 * usual : usual;  // the paper speaks of these
}

RangefinderSceneConfig scene_of_logs() {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.beam.noise = RangeNoise{sigma_range_m};
  return scene;
}

void add_errors(const RangefinderReport& report, const RangefinderSample& sample, BeamErrors& errors) {
  errors.reprojection_px.push_back(reprojection_px(report, sample));
  errors.origin_mm.push_back(1e3 * origin_error_m(report, sample));
  errors.direction_mrad.push_back(1e3 * direction_error_rad(report, sample).norm());
  errors.coordinates_mm.push_back(1e3 * coordinate_error_m(report, sample));
  for (const double error : spot_errors_px(report, sample)) errors.spots_px.push_back(error);
}

std::vector<double> counts_as_numbers() { return {pose_counts.begin(), pose_counts.end()}; }

FigureTable against_poses(const BeamErrorTable& table, ErrorsOfBeams kind,
                          const std::vector<std::pair<std::string, std::size_t>>& curves) {
  FigureTable figure{"", {{"num_poses", counts_as_numbers()}}};
  for (const auto& [name, way] : curves) {
    std::vector<double> column;
    for (std::size_t n = 0; n < pose_counts.size(); ++n) column.push_back(median_error(table, way, n, kind));
    figure.columns.emplace_back(name, std::move(column));
  }
  figure.across = "number of poses";
  return figure;
}

/// Spots of shots that were not calibrated with: where they are, and where a beam of 18 other shots has them.
FigureTable figure_6(const ReproduceConfig& config) {
  RangefinderSceneConfig scene = scene_of_logs();
  const ShotNoise noise{.sigma_corner_px = corner_px};
  const auto log = draw_rangefinder_sample(scene, noise, 610000 * config.seed);
  scene.num_shots = 12;
  const auto others = draw_rangefinder_sample(scene, noise, 610000 * config.seed + 7);
  FigureTable figure{"6", {}};
  const auto add = [&](const std::string& name, auto pixel_of) {
    std::vector<double> u, v;
    for (const Shot& shot : others.simulated.shots) {
      const std::optional<Eigen::Vector2d> px = pixel_of(shot);
      u.push_back(px ? px->x() : not_a_number);
      v.push_back(px ? px->y() : not_a_number);
    }
    figure.columns.emplace_back(name + "_u_px", std::move(u));
    figure.columns.emplace_back(name + "_v_px", std::move(v));
  };
  std::vector<double> ranges;
  for (const Shot& shot : others.simulated.shots) ranges.push_back(shot.range_m);
  figure.columns.emplace_back("range_m", std::move(ranges));
  add("actual", [](const Shot& shot) { return shot.spot ? std::optional(shot.spot->px) : std::nullopt; });
  const std::array<std::pair<const char*, std::size_t>, 3> drawn{
      {{"method_1", spot_global}, {"method_2", plane_global}, {"best", joint_global}}};
  for (const auto& [name, way] : drawn) {
    const RangefinderReport report = solve_sample(log, config_of_way(way));
    add(name, [&](const Shot& shot) { return project(report.camera, point_at(report.beam, shot.range_m)); });
  }
  figure.title = "Actual and computed position of the laser spot";
  figure.caption =
      "12 shots that were not calibrated with. Left: where the spot is found in the image (0.3 px), and where the "
      "beam of 18 other shots puts it at the reading (1 mm). Right: computed minus actual.";
  return figure;
}

FigureTable figure_7(const BeamErrorTable& table) {
  FigureTable figure = against_poses(table, &BeamErrors::reprojection_px,
                                     {{"method_1_px", spot_alone},
                                      {"method_1_optimised_px", spot_global},
                                      {"method_2_px", plane_alone},
                                      {"method_2_optimised_px", plane_global},
                                      {"best_px", joint_global}});
  figure.id = "7";
  figure.title = "Position error of the spot against the number of poses";
  figure.up = "position error";
  figure.caption =
      "RMS distance of computed and true spot over readings of 0.5 to 4 m; median over the logs. Each method alone "
      "(lens and boards fixed) and optimised (all together). Method 2 needs five poses.";
  return figure;
}

/// Share of the spots in each quarter of a pixel; the last one holds all beyond.
FigureTable figure_8(const BeamErrorTable& table, const std::string& id, const std::string& name, std::size_t alone,
                     std::size_t global, double max_px) {
  constexpr int num_bins = 24;
  FigureTable figure{id, {{"error_px", {}}, {name + "_percent", {}}, {name + "_optimised_percent", {}}}};
  const double width_px = max_px / num_bins;
  for (int bin = 0; bin < num_bins; ++bin) figure.columns[0].second.push_back((bin + 0.5) * width_px);
  for (std::size_t column = 1; column <= 2; ++column) {
    const std::vector<double>& errors = table[column == 1 ? alone : global][at_18].spots_px;
    std::vector<double>& shares = figure.columns[column].second;
    shares.assign(num_bins, 0.0);
    for (const double error : errors)
      shares[static_cast<std::size_t>(std::clamp(static_cast<int>(error / width_px), 0, num_bins - 1))] +=
          100.0 / static_cast<double>(errors.size());
  }
  figure.title = name == "method_1" ? "Distribution of the position error, method 1" : "Method 2";
  figure.across = "position error of the spot";
  figure.up = "share of spots";
  figure.caption =
      "18 poses, readings of 0.5 to 4 m in steps of 0.1 m, all logs; without and with global optimisation. The last "
      "bin holds all that lies beyond.";
  return figure;
}

FigureTable figure_9(const BeamErrorTable& table) {
  FigureTable figure =
      against_poses(table, &BeamErrors::coordinates_mm,
                    {{"method_1_mm", spot_global}, {"method_2_mm", plane_global}, {"best_mm", joint_global}});
  figure.id = "9";
  figure.title = "Coordinate error of the spot against the number of poses";
  figure.up = "coordinate error";
  figure.caption =
      "RMS distance of the computed and the true spot in space, in the camera's coordinates, over readings of 0.5 to "
      "4 m; with global optimisation; median over the logs.";
  return figure;
}

}  // namespace

RangefinderConfig config_of_way(std::size_t way) {
  RangefinderConfig config = given_config(ways[way].method);
  config.refine = ways[way].refine;
  config.sigma_range_m = sigma_range_m;
  config.sigma_corner_px = corner_px;
  return config;
}

BeamErrorTable beam_error_table(const ReproduceConfig& config) {
  BeamErrorTable table;
  RangefinderSceneConfig scene = scene_of_logs();
  const ShotNoise noise{.sigma_corner_px = corner_px};
  for (std::size_t n = 0; n < pose_counts.size(); ++n) {
    scene.num_shots = pose_counts[n];
    for (int log = 0; log < num_logs(config, n); ++log) {
      report_progress(config.progress, "poses", n, pose_counts.size());
      const auto sample =
          draw_rangefinder_sample(scene, noise, 600000 * config.seed + 1000 * n + static_cast<std::uint64_t>(log));
      for (std::size_t way = 0; way < num_ways; ++way) {
        if (ways[way].method == RangefinderMethod::plane && scene.num_shots < 5) continue;  // too few for it
        add_errors(solve_sample(sample, config_of_way(way)), sample, table[way][n]);
      }
    }
  }
  return table;
}

double median_error(const BeamErrorTable& table, std::size_t way, std::size_t n, ErrorsOfBeams kind) {
  return quantile_of(table[way][n].*kind, 0.5);
}

std::vector<FigureTable> wang_figures(const ReproduceConfig& config, const BeamErrorTable& table) {
  return {figure_6(config), figure_7(table), figure_8(table, "8", "method_1", spot_alone, spot_global, 1.5),
          figure_8(table, "8_method_2", "method_2", plane_alone, plane_global, 12.0), figure_9(table)};
}

}  // namespace alidade::reproduce
