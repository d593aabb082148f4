#pragma once

#include <array>
#include <vector>

#include "alidade/reproduce/beam_trials.h"
#include "alidade/reproduce/paper_report.h"

// The same simulated logs of 3 to 30 shots, solved in five ways.

namespace alidade::reproduce {

inline constexpr std::array<int, 10> pose_counts{3, 5, 6, 8, 10, 14, 15, 18, 24, 30};
inline constexpr std::size_t at_14 = 5, at_15 = 6, at_18 = 7, at_30 = 9;

/// How a beam is solved for: method 1 and 2 without and with global optimisation, and ours.
enum WayIndex : std::size_t { spot_alone, spot_global, plane_alone, plane_global, joint_global };
inline constexpr std::size_t num_ways = 5;
[[nodiscard]] RangefinderConfig config_of_way(std::size_t way);

/// One number a log; `spots_px` 36 a log.
struct BeamErrors {
  std::vector<double> reprojection_px, origin_mm, direction_mrad, coordinates_mm, spots_px;
};
using ErrorsOfBeams = std::vector<double> BeamErrors::*;

/// By way and by index in pose_counts; no errors where a way needs more shots.
using BeamErrorTable = std::array<std::array<BeamErrors, pose_counts.size()>, num_ways>;
[[nodiscard]] BeamErrorTable beam_error_table(const ReproduceConfig& config);

[[nodiscard]] double median_error(const BeamErrorTable& table, std::size_t way, std::size_t n, ErrorsOfBeams kind);

/// Figures 6 to 9, as their captions have them.
[[nodiscard]] std::vector<FigureTable> wang_figures(const ReproduceConfig& config, const BeamErrorTable& table);

}  // namespace alidade::reproduce
