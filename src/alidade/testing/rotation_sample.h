#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "alidade/files/csv.h"
#include "alidade/observe/intrinsics_estimate.h"
#include "alidade/observe/rotation_frame.h"
#include "alidade/reproduce/fang_scenes.h"
#include "alidade/reproduce/paper_report.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/reference_case.h"

namespace alidade::testing {

using reproduce::add_paper_noise;
using reproduce::error_px;
using reproduce::observe_log;
using reproduce::paper_scale;
using reproduce::paper_scene;
using reproduce::paper_sigma_px;
using reproduce::paper_start;
using reproduce::paper_truth;
using reproduce::rms_px;
using reproduce::settle_s;

inline RotationScene random_paper_scene(std::uint64_t seed, int num_points = 4) {
  return paper_scene(draw_points(780, 582, num_points, seed));
}

/// A random scene's log without or with the paper's noise.
inline RotationLog paper_log(std::uint64_t seed, bool noisy) {
  RotationLog log = simulate_rotation(random_paper_scene(seed), {.sigma_px = 0.0}, seed);
  if (noisy) add_paper_noise(log, seed + 1000);
  return log;
}

/// A reference case, `cases/NAME.csv` in the folder that ALIDADE_DATA names; nothing without.
inline std::optional<RotationLog> paper_case(const std::string& name) {
  const Csv csv = Csv::read(reference_case(name + ".csv"));
  RotationLog log;
  log.num_points = 4;
  for (std::size_t r = 0; r < csv.num_rows(); ++r) {
    RotationRow row;
    row.t_s = static_cast<double>(r) / 30.0;  // the file has nine digits of it, too few for gains of 10⁵
    row.rate_rad_per_s = {csv.number(r, "omega_x"), csv.number(r, "omega_y"), 0.0};
    for (int i = 1; i <= 4; ++i) {
      std::string point = "p";
      point += std::to_string(i);
      row.px.emplace_back(csv.number(r, point + "x"), csv.number(r, point + "y"));
    }
    log.rows.push_back(std::move(row));
    log.truth.push_back({csv.number(r, "fx"), csv.number(r, "fy"), csv.number(r, "u0"), csv.number(r, "v0")});
  }
  return log;
}

/// The p-quantile, by the sample at or above it.
inline double quantile(std::vector<double> values, double p) { return reproduce::quantile_of(std::move(values), p); }

}  // namespace alidade::testing
