#include "alidade/results/documents/calibration_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "alidade/formats/camera_file.h"
#include "alidade/results/calibration_result.h"
#include "alidade/tables/corner_file.h"
#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::sample_board;
using testing::sample_calibration;
using testing::sample_camera;
using testing::sample_scene;
using testing::sample_views;

std::string text_of(const Calibration& calibration) {
  ResultDocument document;
  document.command = "calibrate";
  document.verdict = calibration.verdict;
  fill_calibration(sample_board, calibration, document);
  return result_text(document);
}

Calibration solved() {
  auto views = sample_views(sample_scene(sample_camera("brown"), 10, 1), 1);
  views[3].corners[7].px.x() += 5.0;  // to be rejected
  views.push_back({"empty.png", {}});
  return sample_calibration(views);
}

Calibration refused() {
  auto views = sample_views(sample_scene(sample_camera("brown"), 2, 1), 1);
  return sample_calibration(views);
}

void expect_names(const json& object, const std::vector<std::string>& names) {
  for (const std::string& name : names) EXPECT_TRUE(object.contains(name)) << name;
}

/// The parts that every result has, by the contract.
void expect_frame(const json& document) {
  expect_names(document, {"schema", "command", "version", "argv", "created_utc", "seed", "seconds", "inputs", "verdict",
                          "counts", "estimate", "stddev", "covariance", "data", "grids"});
  expect_names(document["verdict"], {"state", "exit_code", "sentence", "to_add", "checks"});
  expect_names(document["counts"], {"given", "used", "dropped", "skipped"});
  for (const auto& check : document["verdict"]["checks"]) {
    expect_names(check, {"name", "state", "text", "value", "limit", "unit", "figure"});
  }
  for (const auto& [name, table] : document["data"].items()) {
    for (const auto& [column, values] : table.items()) {
      EXPECT_EQ(values.size(), table.front().size()) << name << "." << column;
    }
  }
  for (const auto& [name, grid] : document["grids"].items()) {
    expect_names(grid, {"cols", "rows", "u0_px", "v0_px", "du_px", "dv_px"});
    for (const auto& [column, values] : grid.items()) {
      if (values.is_array()) {
        EXPECT_EQ(values.size(), grid["cols"].get<std::size_t>() * grid["rows"].get<std::size_t>()) << column;
      }
    }
  }
}

const std::vector<std::string> pose_columns = {"cam_from_board_x_m", "cam_from_board_y_m", "cam_from_board_z_m",
                                               "cam_from_board_qx",  "cam_from_board_qy",  "cam_from_board_qz",
                                               "cam_from_board_qw"};

TEST(CalibrationDocument, HasTheNamesOfTheContract) {
  const Calibration calibration = solved();
  const json document = json::parse(text_of(calibration));
  expect_frame(document);
  const json& estimate = document["estimate"];
  expect_names(estimate, {"camera", "rms_px", "noise_px", "board_shape", "transfer_rms_px", "photos"});
  expect_names(estimate["camera"],
               {"model", "width", "height", "fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2", "k3"});
  for (const auto& photo : estimate["photos"]) expect_names(photo, {"file", "used", "rms_px", "reason"});
  expect_names(document["stddev"]["camera"], {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"});

  const json& data = document["data"];
  expect_names(data, {"photos", "corners", "cells", "rings", "models", "board_points", "next"});
  expect_names(data["photos"], {"name", "used", "reason", "num_corners", "rms_px"});
  expect_names(data["photos"], pose_columns);
  expect_names(data["corners"], {"photo", "col", "row", "u_px", "v_px", "sigma_u_px", "sigma_v_px", "corr_uv",
                                 "residual_u_px", "residual_v_px", "weight"});
  expect_names(data["cells"], {"u_px", "v_px", "count", "mean_u_px", "mean_v_px", "z"});
  expect_names(data["rings"], {"radius_px", "mean_radial_px", "mean_tangential_px", "sigma_px"});
  expect_names(data["models"], {"name", "heldout_rms_px", "sigma_px"});
  expect_names(data["board_points"], {"col", "row", "dx_m", "dy_m", "dz_m", "sigma_dz_m"});
  expect_names(data["next"], pose_columns);
  expect_names(data["next"], {"worst_3sigma_px"});
  const json& grids = document["grids"];
  expect_names(grids["sigma_infinity"], {"sigma_px"});
  expect_names(grids["sigma_working"], {"sigma_px"});
  expect_names(grids["halves"], {"delta_u_px", "delta_v_px", "predicted_sigma_px"});
}

TEST(CalibrationDocument, CountsAndNamesWhatWasRejected) {
  const Calibration calibration = solved();
  const json document = json::parse(text_of(calibration));
  EXPECT_EQ(document["counts"]["given"], 11);
  EXPECT_EQ(document["counts"]["used"], 10);
  EXPECT_EQ(document["counts"]["dropped"], 1);
  ASSERT_EQ(document["counts"]["skipped"].size(), 1u);
  EXPECT_EQ(document["counts"]["skipped"][0]["file"], "empty.png");
  EXPECT_EQ(document["counts"]["skipped"][0]["reason"], "no corners");
  const json& rejected = document["estimate"]["corners_rejected"];
  ASSERT_EQ(rejected.size(), 1u);
  EXPECT_EQ(rejected[0]["file"], photo_name(3));
  EXPECT_EQ(rejected[0]["corner"], 7);
  const auto& weights = document["data"]["corners"]["weight"];
  EXPECT_EQ(std::count(weights.begin(), weights.end(), 0.0), 1);
}

TEST(CalibrationDocument, CovarianceIsThatOfTheFreeParameters) {
  const Calibration calibration = solved();
  const json document = json::parse(text_of(calibration));
  const auto names = document["covariance"]["names"].get<std::vector<std::string>>();
  const auto upper = document["covariance"]["upper"].get<std::vector<double>>();
  ASSERT_EQ(names.size(), 9u);  // all but the skew, which is fixed
  ASSERT_EQ(upper.size(), 45u);
  std::size_t at = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double sigma = document["stddev"]["camera"][names[i]].get<double>();
    EXPECT_NEAR(std::sqrt(upper[at]), sigma, 1e-9 * sigma) << names[i];
    at += names.size() - i;
  }
}

TEST(CalibrationDocument, ARefusalIsADocument) {
  const json document = json::parse(text_of(refused()));
  expect_frame(document);
  EXPECT_EQ(document["verdict"]["state"], "refused");
  EXPECT_EQ(document["verdict"]["exit_code"], 4);
  EXPECT_FALSE(document["verdict"]["to_add"].get<std::string>().empty());
  EXPECT_EQ(document["counts"]["given"], 2);
  EXPECT_EQ(document["counts"]["used"], 0);
  EXPECT_EQ(document["estimate"]["photos"].size(), 2u);
  // The image size, for the page; nothing to be mistaken for a camera.
  EXPECT_EQ(document["estimate"]["camera"].size(), 2u);
  EXPECT_FALSE(document["estimate"]["camera"].contains("fx"));
  expect_names(document["data"], {"photos", "corners"});
}

/// A folder as `alidade calibrate` leaves it.
class ReadCalibration : public ::testing::Test {
 protected:
  void write(const Calibration& calibration) const {
    write_file(path() / "result.json", text_of(calibration));
    write_file(path() / "camera.yaml", camera_text(calibration.camera, CameraFormat::alidade));
    write_file(path() / "board_points.csv", board_points_csv(calibration.board_points));
  }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }
  [[nodiscard]] std::string refusal() const {
    try {
      (void)read_calibration(path());
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(ReadCalibration, GivesBackWhatWasFound) {
  const Calibration calibration = solved();
  write(calibration);
  for (const auto& place : {path(), path() / "result.json"}) {
    const CalibratedNow read = read_calibration(place);
    EXPECT_EQ(params(read.camera.lens), params(calibration.camera.lens));
    EXPECT_LT((read.camera.cov - calibration.camera.cov).norm(), 1e-12 * read.camera.cov.norm());
    EXPECT_EQ(read.board, sample_board);
    EXPECT_DOUBLE_EQ(read.noise_px, calibration.noise_px);
    EXPECT_EQ(read.board_points.size(), 54u);
  }
}

TEST_F(ReadCalibration, ARefusedOneHasNoCamera) {
  write_file(path() / "result.json", text_of(refused()));
  EXPECT_THAT(refusal(), HasSubstr("refused"));
}

TEST_F(ReadCalibration, WhatIsNoneIsSaid) {
  EXPECT_NE(refusal(), "") << "an empty folder";
  for (const std::string text :
       {"", "{}", "[1,2]", "not json", R"({"command":"observe"})",
        R"({"command":"calibrate","verdict":{"exit_code":0},"estimate":{}})", R"({"command":7,"verdict":7})"}) {
    write_file(path() / "result.json", text);
    EXPECT_THAT(refusal(), HasSubstr("result.json")) << text;
  }
  write(solved());
  std::filesystem::remove(path() / "camera.yaml");
  EXPECT_THAT(refusal(), HasSubstr("camera.yaml"));
}

}  // namespace
}  // namespace alidade
