#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/beam_solve.h"
#include "alidade/rangefinder/solve/beam_start.h"
#include "alidade/testing/reference_case.h"

// Cases computed elsewhere, with another program.

namespace alidade {
namespace {

using Json = nlohmann::json;

Json read_case(const std::string& name) { return Json::parse(std::ifstream(testing::reference_case(name + ".json"))); }

template <int size>
Eigen::Matrix<double, size, 1> vector_of(const Json& numbers) {
  Eigen::Matrix<double, size, 1> v;
  for (int i = 0; i < size; ++i) v[i] = numbers.at(static_cast<std::size_t>(i)).get<double>();
  return v;
}

Camera camera_of(const Json& K, const Json& sigma = {}) {
  Camera camera{1280, 960, Calibrated<Pinhole>{}, {}, 0.0, ""};
  Eigen::VectorXd values = Eigen::VectorXd::Zero(5);
  values.head<4>() = vector_of<4>(K);
  camera.lens = with_params(camera.lens, values);
  if (sigma.is_null()) return camera;
  camera.cov = Eigen::MatrixXd::Zero(5, 5);
  camera.cov.diagonal().head<4>() = vector_of<4>(sigma).array().square();
  return camera;
}

std::vector<Shot> shots_of(const Json& reference, bool with_spots, bool with_planes) {
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < reference["L"].size(); ++i) {
    Shot shot;
    shot.range_m = reference["L"][i];
    if (with_spots) shot.spot = Spot{vector_of<2>(reference["spots"][i]), {}};
    if (with_planes) {
      shot.plane =
          Plane{vector_of<3>(reference["planes"][i]), reference["planes"][i][3].get<double>(), Eigen::Matrix4d::Zero()};
    }
    shots.push_back(shot);
  }
  return shots;
}

RangefinderConfig config_for(RangefinderMethod method) {
  RangefinderConfig config;
  config.method = method;
  config.sigma_spot_px = 0.3;
  config.sigma_range_m = 0.002;
  return config;
}

void expect_beam(const Beam& beam, const Json& A, const Json& B, double origin_tolerance_m,
                 double direction_tolerance) {
  EXPECT_LT((beam.origin_in_cam - vector_of<3>(B)).norm(), origin_tolerance_m) << beam.origin_in_cam.transpose();
  EXPECT_LT((beam.direction_in_cam - vector_of<3>(A)).norm(), direction_tolerance) << beam.direction_in_cam.transpose();
}

TEST(ReferenceCases, ExactMeasurementsGiveTheExactBeam) {
  const Json reference = read_case("b_exact");
  const Camera camera = camera_of(reference["K"]);
  const auto solved = [&](RangefinderMethod method, std::size_t num_shots) {
    std::vector<Shot> shots = shots_of(reference, true, true);
    shots.resize(num_shots);
    return calibrate_rangefinder(shots, {}, camera, config_for(method));
  };
  for (const auto& [method, num] :
       std::vector<std::pair<RangefinderMethod, std::size_t>>{{RangefinderMethod::spot, 3},
                                                              {RangefinderMethod::spot, 8},
                                                              {RangefinderMethod::plane, 8},
                                                              {RangefinderMethod::joint, 2},
                                                              {RangefinderMethod::joint, 3},
                                                              {RangefinderMethod::joint, 8}}) {
    SCOPED_TRACE(std::to_string(static_cast<int>(method)) + " with " + std::to_string(num));
    const RangefinderReport report = solved(method, num);
    ASSERT_TRUE(report.status == RangefinderReport::Status::converged);
    expect_beam(report.beam, reference["A"], reference["B"], 1e-8, 1e-8);
    EXPECT_NEAR(direction_angles_rad(report.beam).x(), reference["theta"][0].get<double>(), 1e-8);
    EXPECT_NEAR(direction_angles_rad(report.beam).y(), reference["theta"][1].get<double>(), 1e-8);
  }
}

/// Spots alone are judged alike, whichever method was asked for; and exact ones are not too little.
TEST(ReferenceCases, ExactSpotsAreJudgedByWhatTheyHave) {
  const Json reference = read_case("b_exact");
  const Camera camera = camera_of(reference["K"]);
  const std::vector<Shot> shots = shots_of(reference, true, false);
  for (const std::optional<double> sigma_px : {std::optional<double>{}, std::optional(0.01), std::optional(1e-4)}) {
    std::vector<std::string> judged;
    for (const RangefinderMethod method : {RangefinderMethod::spot, RangefinderMethod::joint}) {
      RangefinderConfig config;
      config.method = method;
      config.sigma_spot_px = sigma_px;
      if (sigma_px == 1e-4) config.sigma_range_m = 1e-6;
      const RangefinderReport report = calibrate_rangefinder(shots, {}, camera, config);
      const Verdict verdict = rangefinder_verdict(report, shots, config);
      EXPECT_TRUE(verdict.exit_code == ExitCode::ok) << verdict.sentence;
      expect_beam(report.beam, reference["A"], reference["B"], 1e-8, 1e-8);
      std::string all = verdict.sentence + verdict.to_add;
      for (const Check& check : verdict.checks) all += check.name + ": " + check.text + '\n';
      judged.push_back(all);
    }
    EXPECT_EQ(judged[0], judged[1]);
  }
}

TEST(ReferenceCases, FivePlanesLeaveTwoBeams) {
  const Json reference = read_case("b_exact");
  std::vector<Shot> shots = shots_of(reference, false, true);
  shots.resize(5);
  const RangefinderReport report =
      calibrate_rangefinder(shots, {}, camera_of(reference["K"]), config_for(RangefinderMethod::plane));
  EXPECT_TRUE(report.status == RangefinderReport::Status::ambiguous);
  ASSERT_EQ(report.alternatives.size(), 1u);
  std::array<Beam, 2> beams{report.beam, report.alternatives[0]};
  std::sort(beams.begin(), beams.end(),
            [](const Beam& a, const Beam& b) { return a.origin_in_cam.y() > b.origin_in_cam.y(); });
  for (std::size_t i = 0; i < 2; ++i)
    expect_beam(beams[i], reference["minimal5"][i]["A"], reference["minimal5"][i]["B"], 1e-8, 1e-8);
}

/// As b_noisy18 has them: planes of the poses given there, exact.
std::vector<Shot> noisy_shots(const Json& reference, bool with_corners) {
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < reference["ranges"].size(); ++i) {
    Shot shot;
    shot.range_m = reference["ranges"][i];
    shot.spot = Spot{vector_of<2>(reference["spots"][i]), {}};
    Eigen::Matrix3d R;
    for (std::size_t row = 0; row < 3; ++row)
      R.row(static_cast<Eigen::Index>(row)) = vector_of<3>(reference["R_init"][i][row]).transpose();
    shot.pose = BoardPose{{Eigen::Quaterniond(R).normalized(), vector_of<3>(reference["t_init"][i])}};
    if (with_corners) {
      shot.board.emplace();
      for (std::size_t k = 0; k < reference["corners"][i].size(); ++k)
        shot.board->corners.push_back({static_cast<int>(k), vector_of<2>(reference["corners"][i][k])});
    }
    shots.push_back(shot);
  }
  return shots;
}

std::vector<Eigen::Vector3d> board_points_of(const Json& reference) {
  std::vector<Eigen::Vector3d> points;
  for (const Json& point : reference["board_points"]) points.push_back(vector_of<3>(point));
  return points;
}

TEST(ReferenceCases, LinearStartsOfTheNoisyShots) {
  const Json reference = read_case("b_noisy18");
  const Camera camera = camera_of(reference["K_prior"]);
  std::vector<PreparedShot> shots;
  for (const Shot& shot : noisy_shots(reference, false)) {
    PreparedShot ready;
    ready.range_m = shot.range_m;
    ready.spot_px = shot.spot->px;
    ready.spot_ray = unproject(camera, shot.spot->px);
    ready.plane = plane_of(shot.pose->cam_from_board);
    shots.push_back(ready);
  }
  std::vector<const PreparedShot*> all;
  for (const PreparedShot& shot : shots) all.push_back(&shot);
  const auto spot = spot_start(all);
  const auto planes = plane_starts(all);
  ASSERT_TRUE(spot && !planes.empty());
  const Json& expected = reference["expected"];
  expect_beam(*spot, expected["m1_linear"]["A"], expected["m1_linear"]["B"], 1e-4, 1e-5);
  expect_beam(planes[0], expected["m2_linear"]["A"], expected["m2_linear"]["B"], 1e-4, 1e-5);
}

TEST(ReferenceCases, BeamAloneOfTheNoisyShots) {
  const Json reference = read_case("b_noisy18");
  const std::vector<Shot> shots = noisy_shots(reference, false);
  for (const auto& [method, name] : std::vector<std::pair<RangefinderMethod, std::string>>{
           {RangefinderMethod::spot, "m1_lm"}, {RangefinderMethod::plane, "m2_lm"}}) {
    SCOPED_TRACE(name);
    RangefinderConfig config = config_for(method);
    config.refine = Refine::beam;
    const auto report = calibrate_rangefinder(shots, {}, camera_of(reference["K_prior"]), config);
    expect_beam(report.beam, reference["expected"][name]["A"], reference["expected"][name]["B"], 1e-4, 1e-5);
  }
}

TEST(ReferenceCases, EverythingRefinedOnTheNoisyShots) {
  const Json reference = read_case("b_noisy18");
  const std::vector<Shot> shots = noisy_shots(reference, true);
  const std::vector<Eigen::Vector3d> points = board_points_of(reference);
  for (const auto& [method, name] : std::vector<std::pair<RangefinderMethod, std::string>>{
           {RangefinderMethod::spot, "1"}, {RangefinderMethod::plane, "2"}, {RangefinderMethod::joint, "12"}}) {
    SCOPED_TRACE(name);
    RangefinderConfig config = config_for(method);
    config.sigma_corner_px = 0.2;
    config.reading_counts_twice = true;  // as the file was computed
    const auto report =
        calibrate_rangefinder(shots, points, camera_of(reference["K_prior"], reference["K_prior_sd"]), config);
    const Json& expected = reference["expected"]["global_" + name];
    const Json& global = reference["global_"][name];
    expect_beam(report.beam, expected["A"], expected["B"], 1e-4, 1e-5);
    EXPECT_NEAR(report.cost / global["cost"].get<double>(), 1.0, 1e-4);
    const Eigen::VectorXd K = params(report.camera.lens);
    EXPECT_LT((K.head<4>() - vector_of<4>(global["K"])).norm(), 1e-2);
    for (Eigen::Index i = 0; i < 4; ++i)
      EXPECT_NEAR(std::sqrt(report.lens_cov_model(i, i)) / global["sd"][static_cast<std::size_t>(i)].get<double>(), 1.0,
                  1e-2);
    // The file's order: lens, direction, origin. The direction's two σ in a basis of its own: their sum counts.
    for (Eigen::Index i = 0; i < 3; ++i)
      EXPECT_NEAR(std::sqrt(report.cov_model(i, i)) / global["sd"][static_cast<std::size_t>(6 + i)].get<double>(), 1.0,
                  1e-3);
    const double sigma_direction_rad = std::sqrt(report.cov_model.block<2, 2>(3, 3).trace());
    EXPECT_NEAR(sigma_direction_rad, std::hypot(global["sd"][4].get<double>(), global["sd"][5].get<double>()),
                1e-3 * sigma_direction_rad);
  }
}

TEST(ReferenceCases, Table1OfThePaperHasItsSignsTurned) {
  const Json reference = read_case("b_table1");
  Beam beam;  // Table 2, method 1
  beam.direction_in_cam = {std::cos(1.557), std::cos(1.586), 0.0};
  beam.direction_in_cam.z() = std::sqrt(1.0 - beam.direction_in_cam.squaredNorm());
  beam.origin_in_cam = {0.04, -0.07, 0.04};
  const Camera camera = camera_of({1200.0, 1200.0, 640.0, 480.0});
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < reference["table"].size(); ++i) {
    const Eigen::Vector4d printed_mm = vector_of<4>(reference["table"][i]);
    Shot shot;
    // As printed every board is behind the camera; rotated by half a turn, the plane is N·X = |N|².
    shot.plane = Plane{-printed_mm.head<3>().normalized(), -printed_mm.head<3>().norm() / 1000.0, {}};
    shot.plane->cov.setZero();
    EXPECT_LT((shot.plane->normal_in_cam - vector_of<3>(reference["normal"][i])).norm(), 1e-12);
    EXPECT_NEAR(-1000.0 * shot.plane->d_m, reference["distance_mm"][i].get<double>(), 1e-6);
    PreparedShot ready;
    ready.plane = shot.plane;
    const auto residual = shot_residual(ready, beam, camera, {});
    ASSERT_TRUE(residual);
    shot.range_m = residual->r[0];  // predicted − 0
    EXPECT_NEAR(1000.0 * shot.range_m, reference["implied_range_mm"][i].get<double>(), 1e-6);
    shot.spot = Spot{*project(camera, point_at(beam, shot.range_m)), {}};
    shots.push_back(shot);
  }
  for (const RangefinderMethod method : {RangefinderMethod::plane, RangefinderMethod::spot}) {
    const RangefinderConfig config = config_for(method);
    const Verdict verdict = rangefinder_verdict(calibrate_rangefinder(shots, {}, camera, config), shots, config);
    EXPECT_TRUE(verdict.exit_code == ExitCode::undetermined) << verdict.sentence;
    EXPECT_NE(verdict.sentence.find("equal ranges"), std::string::npos) << verdict.sentence;
    EXPECT_NE(verdict.to_add.find("--method joint"), std::string::npos) << verdict.to_add;
  }
}

void expect_refused(const Json& reference, RangefinderMethod method, const std::string& reason) {
  const std::vector<Shot> shots = shots_of(reference, true, true);
  const RangefinderConfig config = config_for(method);
  const auto report = calibrate_rangefinder(shots, {}, camera_of(reference["K"]), config);
  const Verdict verdict = rangefinder_verdict(report, shots, config);
  EXPECT_TRUE(verdict.exit_code == ExitCode::undetermined) << verdict.sentence;
  EXPECT_NE(verdict.sentence.find(reason), std::string::npos) << verdict.sentence;
}

TEST(ReferenceCases, FrontalBoardsAreRefused) {
  const Json reference = read_case("b_degenerate_fronto_parallel");
  expect_refused(reference, RangefinderMethod::plane, "frontal boards");
}

TEST(ReferenceCases, EqualRangesAreRefused) {
  const Json reference = read_case("b_degenerate_equal_range");
  expect_refused(reference, RangefinderMethod::plane, "equal ranges");
  expect_refused(reference, RangefinderMethod::spot, "equal ranges");
}

}  // namespace
}  // namespace alidade
