#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "alidade/io/csv.h"
#include "alidade/observe/intrinsics_estimate.h"
#include "alidade/observe/rotation_frame.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"

namespace alidade::testing {

// The paper's camera, picture and first guess. Fang et al. 2011, section V.
inline const PixelScale paper_scale{{390.0, 291.0}, 400.0};
inline const Eigen::Vector4d paper_truth(710.0, 700.0, 390.0, 290.0), paper_start(500.0, 510.0, 400.0, 300.0);
inline const double paper_sigma_px = std::sqrt(0.1);

inline RotationScene paper_scene(std::vector<Eigen::Vector2d> start_px) {
  RotationScene scene;
  scene.start_px = std::move(start_px);
  scene.motion = paper_rate;
  return scene;
}

inline RotationScene random_paper_scene(std::uint64_t seed, int num_points = 4) {
  return paper_scene(draw_points(780, 582, num_points, seed));
}

/// The paper's noise: of x of the first and third point, of y of the second and fourth.
inline void add_paper_noise(RotationLog& log, std::uint64_t seed) {
  Draws draws(seed);
  for (RotationRow& row : log.rows)
    for (std::size_t i = 0; i < row.px.size(); ++i) row.px[i][i % 2] += paper_sigma_px * draws.normal();
}

/// A random scene's log without or with the paper's noise.
inline RotationLog paper_log(std::uint64_t seed, bool noisy) {
  RotationLog log = simulate_rotation(random_paper_scene(seed), {.sigma_px = 0.0}, seed);
  if (noisy) add_paper_noise(log, seed + 1000);
  return log;
}

/// A reference case, `cases/NAME.csv` in the folder that ALIDADE_DATA names; nothing without.
inline std::optional<RotationLog> paper_case(const std::string& name) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) return std::nullopt;
  const Csv csv = Csv::read(std::string(data) + "/cases/" + name + ".csv");
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

/// The estimate after each row.
template <class Estimator>
std::vector<IntrinsicsEstimate> observe_log(Estimator& estimator, const RotationLog& log) {
  MotionReader reader(log.source, 0.5);
  std::vector<IntrinsicsEstimate> estimates;
  estimates.reserve(log.rows.size());
  for (const RotationRow& row : log.rows) estimates.push_back(estimator.step(reader.next(row)));
  return estimates;
}

/// Estimate − truth of the four intrinsics in row `r`; infinite where there is none. [px]
inline Eigen::Vector4d error_px(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates,
                                std::size_t r) {
  if (!estimates[r].has_value) return Eigen::Vector4d::Constant(std::numeric_limits<double>::infinity());
  return estimates[r].values() - Eigen::Map<const Eigen::Vector4d>(log.truth[r].data());
}

/// Time after `from_s` from which on all four errors stay within `share` of their values, until `to_s`.
inline double settle_s(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates, double share,
                       double from_s, double to_s) {
  double settled_s = from_s;
  for (std::size_t r = 0; r < log.rows.size() && log.rows[r].t_s <= to_s + 1e-9; ++r) {
    if (log.rows[r].t_s < from_s - 1e-9) continue;
    const Eigen::Map<const Eigen::Array4d> truth(log.truth[r].data());
    if ((error_px(log, estimates, r).array().abs() > share * truth).any()) settled_s = log.rows[r].t_s;
  }
  return settled_s - from_s;
}

/// RMS of each error over [from_s, to_s]. [px]
inline Eigen::Vector4d rms_px(const RotationLog& log, const std::vector<IntrinsicsEstimate>& estimates, double from_s,
                              double to_s) {
  Eigen::Array4d sum = Eigen::Array4d::Zero();
  double count = 0.0;
  for (std::size_t r = 0; r < log.rows.size(); ++r) {
    if (log.rows[r].t_s < from_s - 1e-9 || log.rows[r].t_s > to_s + 1e-9) continue;
    sum += error_px(log, estimates, r).array().square();
    ++count;
  }
  return (sum / count).sqrt();
}

/// The p-quantile, by the sample at or above it.
inline double quantile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  const auto index = static_cast<std::size_t>(p * static_cast<double>(values.size() - 1) + 0.5);
  return values[index];
}

}  // namespace alidade::testing
