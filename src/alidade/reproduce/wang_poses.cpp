#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/reproduce/beam_trials.h"
#include "alidade/reproduce/papers.h"
#include "alidade/reproduce/wang_experiments.h"

namespace alidade::reproduce {
namespace {

using Values = std::vector<double>;

constexpr std::array<int, 9> pose_counts{3, 5, 6, 8, 10, 14, 18, 24, 30};
constexpr std::size_t at_14 = 5, at_18 = 6;

/// How a beam is solved for: method 1 and 2 without and with global optimisation, and ours.
struct Way {
  RangefinderMethod method;
  Refine refine;
};
constexpr std::array<Way, 5> ways{{{RangefinderMethod::spot, Refine::beam},
                                   {RangefinderMethod::spot, Refine::all},
                                   {RangefinderMethod::plane, Refine::beam},
                                   {RangefinderMethod::plane, Refine::all},
                                   {RangefinderMethod::joint, Refine::all}}};
enum WayIndex : std::size_t { spot_alone, spot_global, plane_alone, plane_global, joint_global };

struct Errors {
  Values reprojection_px, position_mm, direction_mrad;
};
/// By way and by place in pose_counts.
using ErrorTable = std::array<std::array<Errors, pose_counts.size()>, ways.size()>;

int num_trials(const ReproduceConfig& config, std::size_t count) {
  const int usual = config.quick ? 20 : 200;
  return count == at_14 || count == at_18 ? 3 * usual : usual;  // of these two the paper says something
}

RangefinderConfig config_for(const Way& way) {
  RangefinderConfig config = told_config(way.method);
  config.refine = way.refine;
  config.range_noise = RangeNoise{0.001};
  config.sigma_corner_px = 0.1;
  return config;
}

ErrorTable error_table(const ReproduceConfig& config) {
  ErrorTable table;
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.beam.noise = RangeNoise{0.001};
  const ShotNoise noise{.sigma_corner_px = 0.1};
  for (std::size_t n = 0; n < pose_counts.size(); ++n) {
    scene.num_shots = pose_counts[n];
    for (int trial = 0; trial < num_trials(config, n); ++trial) {
      report_progress(config.progress, "poses", n, pose_counts.size());
      const auto sample =
          draw_rangefinder_sample(scene, noise, 600000 * config.seed + 1000 * n + static_cast<std::uint64_t>(trial));
      for (std::size_t way = 0; way < ways.size(); ++way) {
        if (ways[way].method == RangefinderMethod::plane && scene.num_shots < 5) continue;  // too few for it
        const RangefinderReport report = solve_sample(sample, config_for(ways[way]));
        Errors& errors = table[way][n];
        errors.reprojection_px.push_back(reprojection_px(report, sample));
        errors.position_mm.push_back(1e3 * origin_error_m(report, sample));
        errors.direction_mrad.push_back(1e3 * direction_error_rad(report, sample).norm());
      }
    }
  }
  return table;
}

double median_of(const ErrorTable& table, std::size_t way, std::size_t n, Values Errors::*kind) {
  return quantile_of(table[way][n].*kind, 0.5);
}

FigureTable figure_of(const std::string& id, const ErrorTable& table,
                      const std::vector<std::pair<std::string, std::size_t>>& curves, Values Errors::*kind) {
  FigureTable figure{id, {{"num_poses", Values(pose_counts.begin(), pose_counts.end())}}};
  for (const auto& [name, way] : curves) {
    Values column;
    for (std::size_t n = 0; n < pose_counts.size(); ++n) column.push_back(median_of(table, way, n, kind));
    figure.columns.emplace_back(name, std::move(column));
  }
  return figure;
}

/// The least number of poses from which on nine draws in ten are within 3 px.
double acceptable_from(const ErrorTable& table, std::size_t way) {
  double from = not_a_number;
  for (std::size_t n = pose_counts.size(); n-- > 0;) {
    if (table[way][n].reprojection_px.empty() || quantile_of(table[way][n].reprojection_px, 0.9) > 3.0) break;
    from = pose_counts[n];
  }
  return from;
}

Claim within_3px(const ErrorTable& table, std::size_t way, std::size_t n, const std::string& id,
                 const std::string& figure) {
  const int poses = pose_counts[n];
  const Values& errors = table[way][n].reprojection_px;
  Claim claim{id,
              fmt::format("method {} is within 3 px from {} poses", way == spot_global ? 1 : 2, poses),
              "px",
              3.0,
              quantile_of(errors, 0.5),
              median_of(table, joint_global, n, &Errors::reprojection_px)};
  claim.holds = at_most(errors, 3.0);
  claim.words = fmt::format("Median; nine in ten are within {:.2g} px. Nine in ten keep 3 px from {:.0f} poses on.",
                            quantile_of(errors, 0.9), acceptable_from(table, way));
  claim.figure = figure;
  return claim;
}

/// Median ratio over all numbers of poses from 6 on.
double pooled_ratio(const ErrorTable& table, std::size_t way, std::size_t other, Values Errors::*kind) {
  Values ratios;
  for (std::size_t n = 2; n < pose_counts.size(); ++n)
    ratios.push_back(median_of(table, way, n, kind) / median_of(table, other, n, kind));
  return quantile_of(ratios, 0.5);
}

Claim global_is_better(const ErrorTable& table) {
  const std::array<double, 4> ratios{pooled_ratio(table, spot_global, spot_alone, &Errors::position_mm),
                                     pooled_ratio(table, spot_global, spot_alone, &Errors::direction_mrad),
                                     pooled_ratio(table, plane_global, plane_alone, &Errors::position_mm),
                                     pooled_ratio(table, plane_global, plane_alone, &Errors::direction_mrad)};
  constexpr double clearly = 0.9;  // a tenth less
  const auto better = std::ranges::count_if(ratios, [](double ratio) { return ratio < clearly; });
  Claim claim{"global-better",
              "global optimisation is clearly better: error with it over error without, largest of four", "",
              not_a_number, std::ranges::max(ratios)};
  claim.holds = better == 4 ? Holds::reproduced : better > 0 ? Holds::in_shape : Holds::not_reproducible;
  claim.words = fmt::format(
      "Medians over 6 to 30 poses: method 1 origin {:.2f}, direction {:.2f}; method 2 origin {:.2f}, "
      "direction {:.2f}. The paper prints no number; a tenth less is what we take for clearly.",
      ratios[0], ratios[1], ratios[2], ratios[3]);
  claim.figure = "6";
  return claim;
}

Claim spot_is_better(const ErrorTable& table) {
  const double reprojection = pooled_ratio(table, spot_global, plane_global, &Errors::reprojection_px),
               position = pooled_ratio(table, spot_global, plane_global, &Errors::position_mm);
  Claim claim{
      "method1-better", "method 1 is better than method 2: its reprojection error over the other's", "", not_a_number,
      reprojection,     pooled_ratio(table, joint_global, plane_global, &Errors::reprojection_px)};
  claim.holds = reprojection >= 1.0 ? Holds::not_reproducible : position < 0.9 ? Holds::reproduced : Holds::in_shape;
  claim.words = fmt::format(
      "Much better where the spot is seen in the picture; the origin is not ({:.2f} of the other's "
      "error): method 2 tells its place along the beam better, method 1 across it.",
      position);
  claim.figure = "8";
  return claim;
}

}  // namespace

Experiment wang_poses(const ReproduceConfig& config) {
  const ErrorTable table = error_table(config);
  Experiment experiment{"poses", "Figures 6–9: errors against the number of poses",
                        "Simulated logs of 3 to 30 shots on boards between 0.5 and 4 m; method 1 (spots) and method 2 "
                        "(planes), each without "
                        "(lens and poses held) and with global optimisation, and ours (both together). Reprojection: "
                        "RMS distance of predicted "
                        "and true spot over 0.5 to 4 m. Medians over the logs.",
                        "The paper does not say its noise: readings 1 mm, corners 0.1 px, spots 0.3 px, lens known to "
                        "1.5, 1.5, 2, 2 px. With "
                        "readings of 2 mm method 2 needs 24 poses and more for 3 px. Which figure shows which error is "
                        "our choice: 6 and 7 "
                        "reprojection of method 1 and 2, 8 origin, 9 direction."};
  experiment.claims = {within_3px(table, spot_global, at_14, "method1-from-14", "6"),
                       within_3px(table, plane_global, at_18, "method2-from-18", "7"), global_is_better(table),
                       spot_is_better(table)};
  experiment.figures = {
      figure_of("6", table,
                {{"method_1_px", spot_alone}, {"method_1_global_px", spot_global}, {"best_px", joint_global}},
                &Errors::reprojection_px),
      figure_of("7", table,
                {{"method_2_px", plane_alone}, {"method_2_global_px", plane_global}, {"best_px", joint_global}},
                &Errors::reprojection_px),
      figure_of("8", table,
                {{"method_1_global_mm", spot_global}, {"method_2_global_mm", plane_global}, {"best_mm", joint_global}},
                &Errors::position_mm),
      figure_of("9", table,
                {{"method_1_mrad", spot_alone},
                 {"method_1_global_mrad", spot_global},
                 {"method_2_mrad", plane_alone},
                 {"method_2_global_mrad", plane_global},
                 {"best_mrad", joint_global}},
                &Errors::direction_mrad)};
  return experiment;
}

PaperReport reproduce_wang2020(const ReproduceConfig& config) {
  PaperReport report{
      "wang2020",
      "Wang, Li, \"Calibration method of laser range finder and camera in information fusion process\", 2020",
      {}};
  report.experiments = {wang_table_1(), wang_table_2(config), wang_poses(config)};
  return report;
}

}  // namespace alidade::reproduce
