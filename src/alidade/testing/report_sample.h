#pragma once

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "alidade/testing/random.h"

namespace alidade::testing {

using Json = nlohmann::ordered_json;

inline constexpr int board_cols = 9, board_rows = 6, corners_per_photo = board_cols * board_rows;

inline void append_pose(Json& table, double x_m, double y_m, double z_m) {
  const std::vector<std::pair<const char*, double>> parts{{"x_m", x_m}, {"y_m", y_m}, {"z_m", z_m}, {"qx", 0.1},
                                                          {"qy", 0.2},  {"qz", 0.0},  {"qw", 0.97}};
  for (const auto& [name, value] : parts) table[std::string("cam_from_board_") + name].push_back(value);
}

inline Json photos_and_corners(int num_photos) {
  auto rng = make_rng();
  std::normal_distribution<> residual_px(0.0, 0.1);
  std::uniform_real_distribution<> shift_px(0.0, 250.0);
  Json photos, corners;
  for (int i = 0; i < num_photos; ++i) {
    photos["name"].push_back("photo" + std::to_string(i) + ".jpg");
    photos["used"].push_back(true);
    photos["reason"].push_back("");
    photos["num_corners"].push_back(corners_per_photo);
    photos["rms_px"].push_back(0.1 + 0.01 * (i % 7));
    append_pose(photos, -0.1 + 0.001 * (i % 90), -0.05, 0.4);
    const double u0 = shift_px(rng), v0 = shift_px(rng);
    for (int k = 0; k < corners_per_photo; ++k) {
      const std::vector<std::pair<const char*, double>> row{
          {"photo", i},
          {"col", k % board_cols},
          {"row", k / board_cols},
          {"u_px", std::round(100.0 * (u0 + 40 * (k % board_cols))) / 100},
          {"v_px", std::round(100.0 * (v0 + 38 * (k / board_cols))) / 100},
          {"sigma_u_px", 0.05},
          {"sigma_v_px", 0.04},
          {"corr_uv", 0.2},
          {"residual_u_px", std::round(1e4 * residual_px(rng)) / 1e4},
          {"residual_v_px", std::round(1e4 * residual_px(rng)) / 1e4},
          {"weight", 1.0}};
      for (const auto& [name, value] : row) corners[name].push_back(value);
    }
  }
  return {{"photos", photos}, {"corners", corners}};
}

inline Json grid_of(const std::vector<std::string>& names) {
  constexpr int cols = 16, rows = 12;
  Json grid{{"cols", cols}, {"rows", rows},        {"u0_px", 0.0},
            {"v0_px", 0.0}, {"du_px", 639.0 / 15}, {"dv_px", 479.0 / 11}};
  for (const std::string& name : names)
    for (int row = 0; row < rows; ++row)
      for (int col = 0; col < cols; ++col)
        grid[name].push_back(0.03 * std::exp(0.3 * std::hypot(col - 7.5, row - 5.5)));
  return grid;
}

inline void add_small_tables(Json& data) {
  for (int i = 0; i < 12; ++i) {
    data["cells"]["u_px"].push_back(80.0 + 160.0 * (i % 4));
    data["cells"]["v_px"].push_back(80.0 + 160.0 * (i / 4));
    data["cells"]["count"].push_back(i == 0 ? 0 : 50);
    data["cells"]["mean_u_px"].push_back(i == 0 ? Json() : Json(0.01 * i));
    data["cells"]["mean_v_px"].push_back(i == 0 ? Json() : Json(0.02));
    data["cells"]["z"].push_back(i == 0 ? Json() : Json(0.5 * i));
    data["rings"]["radius_px"].push_back(30.0 * i + 15.0);
    data["rings"]["mean_radial_px"].push_back(0.01);
    data["rings"]["mean_tangential_px"].push_back(-0.01);
    data["rings"]["sigma_px"].push_back(0.02);
  }
  data["models"] = {{"name", {"brown", "richer"}}, {"heldout_rms_px", {0.2, 0.19}}, {"sigma_px", {0.01, 0.01}}};
  for (int k = 0; k < corners_per_photo; ++k) {
    const std::vector<std::pair<const char*, double>> row{{"col", k % board_cols}, {"row", k / board_cols},
                                                          {"dx_m", 1e-5},          {"dy_m", -2e-5},
                                                          {"dz_m", 1e-5 * k},      {"sigma_dz_m", 3e-5}};
    for (const auto& [name, value] : row) data["board_points"][name].push_back(value);
  }
  append_pose(data["next"], -0.05, -0.05, 0.3);
  data["next"]["worst_3sigma_px"].push_back(0.3);
}

/// A plausible calibrate document with every table and grid of the page.
inline Json sample_document(int num_photos) {
  Json document{{"schema", "alidade-result/1"}, {"command", "calibrate"}, {"version", "0.1.0"}};
  document["argv"] = {"alidade", "calibrate", "a b.jpg", "--board", "9x6", "--square", "0.025"};
  document["created_utc"] = "2026-01-02T03:04:05Z";
  document["seed"] = 7;
  document["seconds"] = {{"total", 0.41}};
  document["inputs"] = Json::array({{{"role", "photo"}, {"name", "photo0.jpg"}, {"bytes", 12345}, {"sha256", "feed"}}});
  document["verdict"] = {
      {"state", "care"},
      {"exit_code", 0},
      {"sentence", "The sentence that says it all."},
      {"to_add", "Add a tilted photo."},
      {"checks",
       Json::array({{{"name", "coverage"}, {"state", "bad"}, {"text", "one corner is empty"}, {"figure", "trust"}}})}};
  document["counts"] = {{"given", num_photos}, {"used", num_photos}, {"dropped", 0}, {"skipped", Json::array()}};
  document["estimate"] = {{"camera",
                           {{"model", "brown"},
                            {"width", 640},
                            {"height", 480},
                            {"fx", 532.8123},
                            {"fy", 532.9},
                            {"cx", 342.5},
                            {"cy", 233.9},
                            {"k1", -0.281}}},
                          {"rms_px", 0.195},
                          {"transfer_rms_px", 0.07}};
  document["stddev"] = {{"camera", {{"fx", 0.4333}, {"fy", 0.45}, {"cx", 0.5}, {"cy", 0.5}, {"k1", 0.005}}}};
  document["covariance"] = {{"names", {"fx", "fy"}}, {"upper", {0.1878, 0.19, 0.2025}}};
  document["data"] = photos_and_corners(num_photos);
  add_small_tables(document["data"]);
  document["grids"] = {{"sigma_infinity", grid_of({"sigma_px"})},
                       {"sigma_working", grid_of({"sigma_px"})},
                       {"halves", grid_of({"delta_u_px", "delta_v_px", "predicted_sigma_px"})}};
  return document;
}

inline std::map<std::string, std::string> sample_pictures(int num_photos, std::size_t bytes) {
  std::map<std::string, std::string> pictures{{"undistorted:photo0.jpg", std::string(bytes, 'U')}};
  for (int i = 0; i < num_photos; ++i) pictures["photo" + std::to_string(i) + ".jpg"] = std::string(bytes, 'J');
  return pictures;
}

}  // namespace alidade::testing
