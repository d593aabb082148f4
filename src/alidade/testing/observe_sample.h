#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <string>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/random.h"

namespace alidade::testing {

/// A zoom of 30 px at 12…14 s.
inline double sample_zoom_px(double t_s) { return 30.0 * std::min(1.0, std::max(0.0, (t_s - 12.0) / 2.0)); }

inline nlohmann::ordered_json sample_number(double value, double step) {
  return std::isfinite(value) ? nlohmann::ordered_json(std::round(value / step) * step) : nlohmann::ordered_json();
}

/// Estimates of one parameter that narrow with time, widen in the zoom, and err by their σ.
inline void append_sample_estimate(nlohmann::ordered_json& steps, const std::string& name, double t_s, double truth,
                                   double sigma_at_1_s, double z) {
  const bool has_value = t_s >= 1.0;
  const double widened = t_s > 12.0 ? 2.0 * std::exp(-2.0 * std::max(0.0, t_s - 14.0)) : 0.0;
  const double bound = sigma_at_1_s * std::pow(std::max(t_s, 0.1), -1.5), sigma = std::hypot(1.05 * bound, widened);
  steps[name + "_px"].push_back(has_value ? sample_number(truth + sigma * z, 1e-4) : nlohmann::ordered_json());
  steps["sigma_" + name + "_px"].push_back(has_value ? sample_number(sigma, 1e-5) : nlohmann::ordered_json());
  steps["truth_" + name + "_px"].push_back(sample_number(truth, 1e-4));
  steps["bound_" + name + "_px"].push_back(t_s > 0.2 ? sample_number(bound, 1e-5) : nlohmann::ordered_json());
}

/// One row of `steps`; `z` are slow errors in σ.
inline void append_sample_step(nlohmann::ordered_json& steps, const RotationLog& log, std::size_t i,
                               const Eigen::Vector4d& z, double nis) {
  const RotationRow& row = log.rows[i];
  const double t = row.t_s;
  const auto at = [&](double event_s) { return i > 0 && log.rows[i - 1].t_s < event_s && t >= event_s; };
  steps["t_s"].push_back(sample_number(t, 1e-4));
  append_sample_estimate(steps, "fx", t, log.truth[i][0], 4.0, z[0]);
  append_sample_estimate(steps, "fy", t, log.truth[i][1], 6.0, z[1]);
  append_sample_estimate(steps, "cx", t, log.truth[i][2], 3.0, z[2]);
  append_sample_estimate(steps, "cy", t, log.truth[i][3], 5.0, z[3]);
  const bool is_burst = at(6.0);
  steps["nis"].push_back(t >= 1.0 ? sample_number(is_burst ? 400.0 : nis, 1e-3) : nlohmann::ordered_json());
  steps["nis_dof"].push_back(2 * log.num_points);
  const char* event = at(1.0)    ? "start"
                      : is_burst ? "burst"
                      : at(9.0)  ? "slip"
                      : at(12.0) ? "zoom"
                      : at(14.2) ? "zoom_end"
                      : at(17.0) ? "restart"
                                 : "";
  steps["event"].push_back(event);
  steps["event_point"].push_back(std::string(event) == "slip" ? nlohmann::ordered_json(2) : nlohmann::ordered_json());
  steps["weak_eigenvalue"].push_back(sample_number(2e-5 * t * t * t / (1.0 + 0.02 * t * t), 1e-9));
  steps["weak_combination"].push_back(t < 5.0 ? "fy" : "fx − cx");
  steps["weak_limit"].push_back(1e-4);
  steps["weak_care"].push_back(3e-4);
  steps["omega_x_rad_per_s"].push_back(sample_number(row.rate_rad_per_s.x(), 1e-6));
  steps["omega_y_rad_per_s"].push_back(sample_number(row.rate_rad_per_s.y(), 1e-6));
  steps["omega_z_rad_per_s"].push_back(sample_number(row.rate_rad_per_s.z(), 1e-6));
}

inline void append_sample_attitude(nlohmann::ordered_json& steps, const Eigen::Quaterniond& start_from_cam) {
  for (const auto& [name, value] :
       {std::pair{"start_from_cam_qx", start_from_cam.x()}, std::pair{"start_from_cam_qy", start_from_cam.y()},
        std::pair{"start_from_cam_qz", start_from_cam.z()}, std::pair{"start_from_cam_qw", start_from_cam.w()}})
    steps[name].push_back(sample_number(value, 1e-6));
}

inline RotationLog sample_rotation(std::size_t num_steps) {
  RotationScene scene;
  scene.start_px = draw_points(scene.width_px, scene.height_px, 6, 3);
  scene.motion = [](double t_s) -> Eigen::Vector3d { return 2.0 * paper_rate(t_s); };
  scene.intrinsics = [](double t_s) {
    const double zoom = sample_zoom_px(t_s);
    return RotatingIntrinsics{.fx = 710.0 + zoom, .fy = 700.0 + zoom};
  };
  RotationLogConfig config;
  config.rate_hz = static_cast<double>(num_steps - 1) / 20.0;
  config.clip_to_picture = true;
  return simulate_rotation(scene, config, 5);
}

/// Pixels of one row that are among every `every`-th.
inline void append_sample_points(nlohmann::ordered_json& points, const RotationLog& log, std::size_t i,
                                 std::size_t every, std::mt19937_64& rng) {
  std::normal_distribution<> normal;
  for (std::size_t k = 0; k < log.num_points; ++k) {
    const Eigen::Vector2d& px = log.rows[i].px[k];
    if ((i * log.num_points + k) % every != 0 || !is_seen(px)) continue;
    const bool is_slip = k == 2 && log.rows[i].t_s > 9.0 && log.rows[i].t_s < 9.5;
    points["step"].push_back(i);
    points["point"].push_back(k);
    points["u_px"].push_back(sample_number(px.x(), 0.01));
    points["v_px"].push_back(sample_number(px.y(), 0.01));
    points["residual_u_px"].push_back(sample_number(0.316 * normal(rng) + (is_slip ? 1.2 : 0.0), 1e-4));
    points["residual_v_px"].push_back(sample_number(0.316 * normal(rng) - (is_slip ? 0.8 : 0.0), 1e-4));
    points["used"].push_back(is_slip ? 0 : 1);
  }
}

inline nlohmann::ordered_json sample_bearings(const RotationLog& log) {
  nlohmann::ordered_json bearings;
  for (std::size_t k = 0; k < log.num_points; ++k) {
    const Eigen::Vector2d& px = log.rows[0].px[k];
    const Eigen::Vector3d ray = Eigen::Vector3d((px.x() - 390.0) / 710.0, (px.y() - 290.0) / 700.0, 1.0).normalized();
    bearings["point"].push_back(k);
    for (const auto& [name, value] : {std::pair{"x", ray.x()}, std::pair{"y", ray.y()}, std::pair{"z", ray.z()}})
      bearings[name].push_back(sample_number(value, 1e-6));
  }
  return bearings;
}

/// Tables `steps`, `points` (about so many rows) and `bearings` of a log.
inline nlohmann::ordered_json sample_observe_tables(const RotationLog& log, std::size_t num_point_rows) {
  auto rng = make_rng();
  std::normal_distribution<> normal;
  std::chi_squared_distribution<> chi2(2.0 * static_cast<double>(log.num_points));
  nlohmann::ordered_json steps, points;
  Eigen::Vector4d z(normal(rng), normal(rng), normal(rng), normal(rng));
  Eigen::Quaterniond start_from_cam = Eigen::Quaterniond::Identity();
  const std::size_t every = std::max<std::size_t>(1, log.rows.size() * log.num_points / num_point_rows);
  for (std::size_t i = 0; i < log.rows.size(); ++i) {
    const double h = i > 0 ? log.rows[i].t_s - log.rows[i - 1].t_s : 0.0, memory = std::exp(-h / 1.5);
    for (double& each : z) each = memory * each + std::sqrt(1.0 - memory * memory) * normal(rng);
    start_from_cam = start_from_cam * exp_so3(log.rows[i].rate_rad_per_s * h);
    append_sample_step(steps, log, i, z, chi2(rng));
    append_sample_attitude(steps, start_from_cam);
    append_sample_points(points, log, i, every, rng);
  }
  return {{"steps", steps}, {"points", points}, {"bearings", sample_bearings(log)}};
}

/// A plausible observe document of 20 s with every table of the page; a zoom, a burst, a slip.
inline nlohmann::ordered_json sample_observe_document(std::size_t num_steps, std::size_t num_point_rows) {
  using Json = nlohmann::ordered_json;
  Json document{{"schema", "alidade-result/1"}, {"command", "observe"}, {"version", "0.1.0"}};
  document["argv"] = {"alidade", "observe", "log.csv", "--method", "hybrid"};
  document["created_utc"] = "2026-01-02T03:04:05Z";
  document["seconds"] = {{"total", 0.09}};
  document["inputs"] = Json::array({{{"role", "log"}, {"name", "log.csv"}, {"bytes", 54321}, {"sha256", "feed"}}});
  document["verdict"] = {
      {"state", "good"},
      {"exit_code", 0},
      {"sentence", "fx 740.00 ± 0.14 px, fy 730.00 ± 0.21 px; it zoomed once, at 12 s."},
      {"to_add", ""},
      {"checks",
       Json::array({{{"name", "motion"}, {"state", "good"}, {"text", "both axes turned"}, {"figure", "motion"}},
                    {{"name", "noise"}, {"state", "care"}, {"text", "1 burst, 1 slip"}, {"figure", "nis"}}})}};
  document["counts"] = {{"given", num_steps}, {"used", num_steps - 1}, {"dropped", 1}, {"skipped", Json::array()}};
  document["estimate"] = {{"camera",
                           {{"model", "pinhole"},
                            {"width", 780},
                            {"height", 582},
                            {"fx", 740.01},
                            {"fy", 730.02},
                            {"cx", 390.0},
                            {"cy", 290.1}}},
                          {"sigma_px", 0.316},
                          {"bound", {{"fx", 0.045}, {"fy", 0.067}, {"cx", 0.034}, {"cy", 0.056}}}};
  document["stddev"] = {{"camera", {{"fx", 0.047}, {"fy", 0.07}, {"cx", 0.035}, {"cy", 0.059}}}};
  document["covariance"] = {{"names", {"fx", "fy", "cx", "cy"}},
                            {"upper", {0.0022, 0.0001, 0.0003, 0.0, 0.0049, 0.0, 0.003, 0.0012, 0.0, 0.0035}}};
  document["data"] = sample_observe_tables(sample_rotation(num_steps), num_point_rows);
  return document;
}

}  // namespace alidade::testing
