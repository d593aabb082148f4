#include "alidade/rig/rig.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "alidade/files/csv.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/simulate/rig.h"
#include "alidade/tables/views_file.h"
#include "alidade/testing/reference_case.h"
#include "alidade/testing/rig_sample.h"

namespace alidade {
namespace {

using Json = nlohmann::json;
using Status = RigReport::Status;

/// A board like the reference case's: its origin at the centre.
std::vector<Eigen::Vector3d> centred(const Board& board) {
  std::vector<Eigen::Vector3d> points = points_in_board(board);
  const Eigen::Vector3d centre = 0.5 * (points.front() + points.back());
  for (Eigen::Vector3d& point : points) point -= centre;
  return points;
}

struct Errors {
  double rotation_rad = 0.0, translation_m = 0.0;  ///< RMS.
};

/// Over a grid of both heads' angles.
Errors errors_of(const Rig& rig, const Rig& truth) {
  Errors sum;
  int num = 0;
  for (const double pan1 : {-0.6, 0.0, 0.6}) {
    for (const double tilt1 : {-0.2, 0.4}) {
      for (const double pan2 : {-0.6, 0.0, 0.6}) {
        for (const double tilt2 : {-0.2, 0.4}) {
          const auto xi = testing::error_between(rig, truth, {pan1, tilt1}, {pan2, tilt2});
          sum.translation_m += xi.head<3>().squaredNorm();
          sum.rotation_rad += xi.tail<3>().squaredNorm();
          ++num;
        }
      }
    }
  }
  return {std::sqrt(sum.rotation_rad / num), std::sqrt(sum.translation_m / num)};
}

RigReport solved(const RigScene& scene, const std::vector<HeadView>& views, const RigConfig& config = {}) {
  return calibrate_rig(views, points_in_board(scene.board), testing::cameras_of(scene.rig), config);
}

class RigReferenceCase : public ::testing::TestWithParam<bool> {};

TEST_P(RigReferenceCase, IsFoundAgain) {
  std::ifstream file(testing::reference_case("c7_rig_calibration.json"));
  const Json reference = Json::parse(file);
  const Board board{.cols = 9, .rows = 6, .square_m = 0.025};
  const ViewsFile views = read_views(testing::reference_case("c7_rig_calibration.csv"), {.num_points = 54});
  ASSERT_EQ(views.views.size(), 36u);
  const std::map<int, Camera> cameras{{1, xiahou_rig()[0].camera}, {2, xiahou_rig()[0].camera}};
  const RigReport report = GetParam() ? calibrate_rig(views.views, centred(board), cameras,
                                                      {.sigma_px = 0.2, .sigma_encoder_rad = 0.02 * degree})
                                      : calibrate_rig_by_need(views.views, centred(board), cameras, {.board = board});
  ASSERT_EQ(report.status, Status::converged);
  EXPECT_EQ(report.views_dropped, 0);
  EXPECT_NEAR(report.chi2_per_dof(), 1.0, 0.1);
  double rotation2 = 0.0, translation2 = 0.0;
  for (const Json& truth : reference["truth_relative_extrinsics"]) {
    const auto value = [&](const char* name) { return truth[name].get<double>(); };
    const Eigen::Vector2d first(value("pan1"), value("tilt1")), second(value("pan2"), value("tilt2"));
    Eigen::Matrix3d R;
    for (std::size_t i = 0; i < 9; ++i) R(int(i / 3), int(i % 3)) = truth["R_c1_to_c2"][i / 3][i % 3];
    const auto t = truth["t_c1_to_c2"].get<std::array<double, 3>>();
    const Rigid3 found =
        cam_from_world(report.rig.heads[1].head, second) * world_from_cam(report.rig.heads[0].head, first);
    rotation2 += std::pow(found.rotation.angularDistance(Eigen::Quaterniond(R)), 2) / 20.0;
    translation2 += (found.translation - Eigen::Vector3d(t.data())).squaredNorm() / 20.0;
  }
  EXPECT_LT(std::sqrt(rotation2) / degree, 0.20);
  EXPECT_LT(std::sqrt(translation2), 0.0035);
}

INSTANTIATE_TEST_SUITE_P(, RigReferenceCase, ::testing::Bool());

/// Not square to each other by half a degree: without that the views contradict each other.
TEST(Rig, TheReferenceCasesAxesAreNotSquare) {
  const ViewsFile views =
      read_views(testing::reference_case("c7_rig_calibration.csv"), {.skip_bad = false, .num_points = 54});
  const Camera camera = xiahou_rig()[0].camera;
  RigConfig config{.sigma_px = 0.2, .sigma_encoder_rad = 0.02 * degree};
  config.estimate_skew = false;
  config.reject_outliers = false;
  const std::vector<Eigen::Vector3d> points = centred({.cols = 9, .rows = 6, .square_m = 0.025});
  const RigReport square = calibrate_rig(views.views, points, {{1, camera}, {2, camera}}, config);
  config.estimate_skew = true;
  const RigReport skew = calibrate_rig(views.views, points, {{1, camera}, {2, camera}}, config);
  EXPECT_GT(square.chi2 - skew.chi2, 100.0);  // two parameters
}

struct Trials {
  double chi2 = 0.0, dof = 0.0, nees = 0.0;    ///< NEES: mean, of 6.
  double rotation2 = 0.0, translation2 = 0.0;  ///< Mean squares.
  double worst_rotation = 0.0, worst_translation = 0.0;
  double sigma_encoder_rad = 0.0;
  int dropped = 0, converged = 0;
};

Trials trials(int runs, const RigSceneConfig& scene_config, const RigConfig& config) {
  Trials sum;
  for (int run = 1; run <= runs; ++run) {
    const auto seed = static_cast<std::uint64_t>(run);
    const RigScene scene = draw_rig_scene(scene_config, seed);
    const RigReport report = solved(scene, simulate_head_views(scene, {}, seed).views, config);
    if (report.status != Status::converged) continue;
    ++sum.converged;
    const Errors errors = errors_of(report.rig, scene.rig);
    sum.rotation2 += errors.rotation_rad * errors.rotation_rad / runs;
    sum.translation2 += errors.translation_m * errors.translation_m / runs;
    sum.worst_rotation = std::max(sum.worst_rotation, errors.rotation_rad);
    sum.worst_translation = std::max(sum.worst_translation, errors.translation_m);
    sum.chi2 += report.chi2;
    sum.dof += report.dof;
    sum.dropped += report.views_dropped;
    sum.sigma_encoder_rad += report.sigma_encoder_rad / runs;
    const Eigen::Vector2d first(0.3, 0.2), second(-0.4, 0.1);
    const auto xi = testing::error_between(report.rig, scene.rig, first, second);
    sum.nees += squared_mahalanobis(xi, relative_covariance(report.rig, 0, first, 1, second)) / runs;
  }
  return sum;
}

TEST(Rig, SimulatedRigsAreFoundAgainFromNominal) {
  constexpr int runs = 48;
  const Trials found = trials(runs, {}, {.sigma_px = 0.2, .sigma_encoder_rad = 0.02 * degree});
  EXPECT_EQ(found.converged, runs);
  EXPECT_EQ(found.dropped, 0);
  EXPECT_LT(std::sqrt(found.rotation2) / degree, 0.20);
  EXPECT_LT(std::sqrt(found.translation2), 0.0035);
  EXPECT_GT(found.chi2 / found.dof, 0.9);
  EXPECT_LT(found.chi2 / found.dof, 1.1);
  // χ²₆ a run: mean 6, σ √12; three standard errors.
  EXPECT_NEAR(found.nees, 6.0, 3.0 * std::sqrt(12.0 / runs));
}

TEST(Rig, NoiseThatIsNotGivenIsEstimated) {
  constexpr int runs = 20;
  const Trials found = trials(runs, {}, {});
  EXPECT_EQ(found.converged, runs);
  EXPECT_NEAR(found.chi2 / found.dof, 1.0, 0.05);
  // 36 views of two readings less 14 + 8 + 30 estimated parameters: some 40 to estimate it from, 11 % per run.
  EXPECT_NEAR(found.sigma_encoder_rad / degree, 0.02, 3.0 * 0.02 * 0.15 / std::sqrt(runs));
  // σ from so few readings widens the tails a little.
  EXPECT_NEAR(found.nees, 6.0, 4.0 * std::sqrt(12.0 / runs));
}

TEST(Rig, AnyMountingIsFoundWithoutAGuess) {
  int num_checked = 0;
  for (const Eigen::Vector3d& turn : {Eigen::Vector3d(0.0, 0.0, 1.57), Eigen::Vector3d(0.0, 0.0, 3.1),
                                      Eigen::Vector3d(0.5, 0.3, -0.4), Eigen::Vector3d(-0.3, 0.2, 0.9)}) {
    RigSceneConfig config;
    for (RigHead& head : xiahou_rig()) config.nominal.push_back(head);
    for (RigHead& head : config.nominal) head.head.cam_from_tilt = exp_so3(turn);
    // Wide enough that heads that look askew still see boards.
    for (RigHead& head : config.nominal)
      head.camera.lens = with_params(head.camera.lens, Eigen::Vector<double, 5>(150.0, 150.0, 160.0, 120.0, 0.0));
    const RigScene scene = draw_rig_scene(config, 3);
    const RigReport report = solved(scene, simulate_head_views(scene, {}, 3).views);
    ASSERT_EQ(report.status, Status::converged) << turn.transpose();
    const Eigen::Vector2d first(0.3, 0.2), second(-0.4, 0.1);
    const auto xi = testing::error_between(report.rig, scene.rig, first, second);
    EXPECT_LT(squared_mahalanobis(xi, relative_covariance(report.rig, 0, first, 1, second)), 35.0);  // χ²₆, 4·10⁻⁶
    ++num_checked;
  }
  EXPECT_EQ(num_checked, 4);
}

TEST(Rig, EncodersThatCountBackwardsAndScalesAreFound) {
  RigSceneConfig scene_config;
  for (RigHead& head : xiahou_rig()) scene_config.nominal.push_back(head);
  scene_config.nominal[0].head.encoder.pan_scale = -1.0;
  scene_config.nominal[1].head.encoder.tilt_scale = 1.03;
  const RigScene scene = draw_rig_scene(scene_config, 2);
  const RigReport report = solved(scene, simulate_head_views(scene, {}, 2).views,
                                  {.sigma_px = 0.2, .sigma_encoder_rad = 0.02 * degree, .estimate_scales = true});
  ASSERT_EQ(report.status, Status::converged);
  const auto expect_scale = [&](std::size_t head, double estimate, double truth, int param) {
    const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(head) + param;
    const double sigma = std::sqrt(report.rig.cov(at, at));
    EXPECT_GT(sigma, 0.0);
    EXPECT_LT(sigma, 0.01);
    EXPECT_NEAR(estimate, truth, 4.0 * sigma);
  };
  expect_scale(0, report.rig.heads[0].head.encoder.pan_scale, -1.0, 17);
  expect_scale(1, report.rig.heads[1].head.encoder.tilt_scale, 1.03, 18);
}

TEST(Rig, WrongViewsAreNamedAndDoNoHarm) {
  int num_wrong = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const RigScene scene = draw_rig_scene({}, seed);
    const SimulatedViews views = simulate_head_views(scene, {.wrong_views = 0.1}, seed);
    const RigReport report = solved(scene, views.views, {.sigma_px = 0.2, .sigma_encoder_rad = 0.02 * degree});
    ASSERT_EQ(report.status, Status::converged) << seed;
    for (std::size_t v = 0; v < views.views.size(); ++v) {
      EXPECT_EQ(report.views[v].used, !views.is_wrong[v]) << seed << ' ' << v << report.views[v].reason;
      EXPECT_EQ(report.views[v].reason.empty(), report.views[v].used);
      num_wrong += views.is_wrong[v] ? 1 : 0;
    }
    EXPECT_LT(report.chi2_per_dof(), 1.15) << seed;
  }
  EXPECT_GE(num_wrong, 30);
}

TEST(Rig, ViewsOfTheOtherHeadAreNamed) {
  const RigScene scene = draw_rig_scene({}, 1);
  std::vector<HeadView> views = simulate_head_views(scene, {}, 1).views;
  ASSERT_EQ(views[1].head, 1);
  views[1].head = 2;
  const RigReport report = solved(scene, views);
  ASSERT_EQ(report.status, Status::converged);
  EXPECT_NE(report.views[1].reason.find("fits head 1; heads swapped?"), std::string::npos) << report.views[1].reason;
}

TEST(Rig, OneHeadAloneIsCalibratedToo) {
  RigSceneConfig config;
  config.nominal = {xiahou_rig()[0]};
  const RigScene scene = draw_rig_scene(config, 4);
  const RigReport report = solved(scene, simulate_head_views(scene, {}, 4).views);
  ASSERT_EQ(report.status, Status::converged);
  EXPECT_EQ(rig_verdict(report, {}).exit_code, ExitCode::ok);
  const Eigen::Vector2d from(-0.3, -0.1), to(0.4, 0.3);
  const auto turn = [&](const Rig& rig) {
    return cam_from_world(rig.heads[0].head, from) * world_from_cam(rig.heads[0].head, to);
  };
  const Rigid3 a = turn(report.rig), b = turn(scene.rig);
  Eigen::Matrix<double, 6, 1> xi;
  xi << b.rotation.conjugate() * (a.translation - b.translation), log_so3(b.rotation.conjugate() * a.rotation);
  EXPECT_LT(squared_mahalanobis(xi, relative_covariance(report.rig, 0, from, 0, to)), 35.0);
}

/// Refused with exit 4 and one sentence that has these words.
void expect_refusal(const RigScene& scene, const std::vector<HeadView>& views, const std::string& words,
                    const std::map<int, Camera>& cameras) {
  const RigReport report = calibrate_rig(views, points_in_board(scene.board), cameras, {});
  const Verdict verdict = rig_verdict(report, {});
  EXPECT_EQ(verdict.exit_code, ExitCode::undetermined) << words << ": " << verdict.sentence;
  EXPECT_NE(verdict.sentence.find(words), std::string::npos) << verdict.sentence;
  EXPECT_FALSE(verdict.to_add.empty()) << words;
}

TEST(Rig, WhatCannotBeDeterminedIsRefusedByName) {
  const auto simulated = [](const std::vector<double>& pans, const std::vector<double>& tilts, bool shared,
                            const std::string& words) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      RigSceneConfig config;
      config.pans_rad = pans;
      config.tilts_rad = tilts;
      config.shared = shared;
      const RigScene scene = draw_rig_scene(config, seed);
      expect_refusal(scene, simulate_head_views(scene, {}, seed).views, words, testing::cameras_of(scene.rig));
    }
  };
  const std::vector<double> pans{-0.5, -0.25, 0.0, 0.25, 0.5}, tilts{-0.2, 0.0, 0.2, 0.4};
  simulated(pans, {0.1}, true, "pan only: its tilt axis cannot be determined");
  simulated({0.0}, tilts, true, "tilt only: its pan axis cannot be determined");
  simulated({0.0, 0.001}, {0.1, 0.101}, true, "does not rotate");
  simulated(pans, tilts, false, "shares no board with another head");
}

TEST(Rig, DegreesAndSwappedCamerasAreNamed) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    RigSceneConfig config;
    for (RigHead& head : xiahou_rig()) config.nominal.push_back(head);
    const Eigen::Vector<double, 5> longer(500.0, 500.0, 150.0, 130.0, 0.0);
    config.nominal[1].camera.lens = with_params(config.nominal[1].camera.lens, longer);
    const RigScene scene = draw_rig_scene(config, seed);
    std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    std::map<int, Camera> cameras = testing::cameras_of(scene.rig);
    std::swap(cameras[1], cameras[2]);
    expect_refusal(scene, views, "heads swapped", cameras);
    std::swap(cameras[1], cameras[2]);
    EXPECT_EQ(calibrate_rig(views, points_in_board(scene.board), cameras, {}).status, Status::converged);
    for (HeadView& view : views) view.pan_tilt_rad /= degree;
    expect_refusal(scene, views, "the angles are degrees", cameras);
  }
}

TEST(Rig, TooFewViewsAreRefused) {
  const RigScene scene = draw_rig_scene({}, 1);
  std::vector<HeadView> views = simulate_head_views(scene, {}, 1).views;
  expect_refusal(scene, {views.begin(), views.begin() + 2}, "three are the least", testing::cameras_of(scene.rig));
  expect_refusal(scene, {}, "no view", testing::cameras_of(scene.rig));
  expect_refusal(scene, views, "no view", {});
}

/// 71 readings of a real head at eight surveyed points, one point an image, by Dai, Xiong & Li, 2011: no view alone
/// gives a pose. The lens is the authors', at half their resolution; their v counts upwards.
TEST(Rig, ARealHeadsSurveyedPointsAreExplainedToTwoPixels) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) GTEST_SKIP() << "set ALIDADE_DATA to the folder that holds data/pantilt-logs";
  const Csv csv = Csv::read(std::string(data) + "/data/pantilt-logs/dai2011_pan_tilt_pixels.csv");
  constexpr double cy = 133.785;
  std::vector<Eigen::Vector3d> points;
  std::vector<HeadView> views;
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const Eigen::Vector3d point(csv.number(row, "x_cm"), csv.number(row, "y_cm"), csv.number(row, "z_cm"));
    auto found = std::ranges::find_if(points, [&](const Eigen::Vector3d& p) { return p.isApprox(point / 100.0); });
    if (found == points.end()) found = points.insert(found, point / 100.0);
    HeadView view;
    view.seen.photo = "row " + std::to_string(row + 1);
    const Eigen::Vector2d px(csv.number(row, "u_px"), 2.0 * cy - csv.number(row, "v_px"));
    view.seen.corners.push_back({static_cast<int>(found - points.begin()), px, Eigen::Matrix2d::Identity()});
    view.pan_tilt_rad = degree * Eigen::Vector2d(csv.number(row, "pan_deg"), csv.number(row, "tilt_deg"));
    views.push_back(view);
  }
  ASSERT_EQ(views.size(), 71u);
  Camera camera{320, 240, Calibrated<Pinhole>{}, {}, 0.0, ""};
  camera.lens = with_params(camera.lens, Eigen::Vector<double, 5>(235.67, 236.49, 150.695, cy, 0.0));
  const RigReport report =
      calibrate_rig(views, points, {{1, camera}},
                    {.sigma_px = 1.0, .sigma_encoder_rad = 0.0, .estimate_scales = true, .reject_outliers = false});
  ASSERT_EQ(report.status, Status::converged);
  EXPECT_EQ(report.views_used, 71);
  EXPECT_LE(report.rms_px / std::sqrt(2.0), 2.0);  // of a coordinate
  // A positive pan rotated this head to the right, a positive tilt up.
  EXPECT_LT(report.rig.heads[0].head.encoder.pan_scale, 0.0);
  EXPECT_GT(report.rig.heads[0].head.encoder.tilt_scale, 0.0);
}

/// The advice of a rig that is known too little: with as many more views of other boards, it is known well enough.
TEST(Rig, AsManyViewsAsAreLackingAreEnough) {
  int num_lacking = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    RigSceneConfig config;
    config.num_boards = 2;
    const auto report_of = [&] {
      const RigScene scene = draw_rig_scene(config, seed);
      return solved(scene, simulate_head_views(scene, {}, seed).views);
    };
    const RigReport report = report_of();
    const std::string advice = rig_verdict(report, {}).to_add;
    const std::size_t number = advice.find("add about ");
    if (number == std::string::npos) continue;
    ++num_lacking;
    const double lacking = std::stod(advice.substr(number + 10));
    const double views_of_a_board = static_cast<double>(report.views.size()) / config.num_boards;
    config.num_boards += static_cast<int>(std::ceil(lacking / views_of_a_board));
    for (const Check& check : rig_verdict(report_of(), {}).checks)
      if (check.name == "rotation" || check.name == "position")
        EXPECT_LT(check.value, 1.15 * check.limit) << "seed " << seed << ": " << check.text;
  }
  EXPECT_GE(num_lacking, 2);
}

/// Two to fifteen views at random: refused, or within what σ says. Some of garbage, some twice, some of two corners.
TEST(Rig, RandomHandfulsAreRefusedOrCovered) {
  std::mt19937_64 rng(1);
  double nees = 0.0;
  int num_refused = 0, num_solved = 0;
  constexpr int runs = 60;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    RigSceneConfig config;
    config.num_boards = static_cast<int>(1 + seed % 4);
    const RigScene scene = draw_rig_scene(config, seed);
    std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    std::ranges::shuffle(views, rng);
    views.resize(std::min<std::size_t>(views.size(), 2 + rng() % 14));
    if (seed % 7 == 0)
      for (Corner& corner : views[0].seen.corners)
        corner.px = Eigen::Vector2d(static_cast<double>(rng() % 320), static_cast<double>(rng() % 240));
    if (seed % 11 == 0) views.push_back(views[0]);
    if (seed % 13 == 0) views[0].seen.corners.resize(2);
    const RigReport report = solved(scene, views);
    const Verdict verdict = rig_verdict(report, {});
    if (verdict.exit_code != ExitCode::ok) {
      EXPECT_FALSE(verdict.sentence.empty() || verdict.to_add.empty());
      ++num_refused;
    } else if (report.rig.heads.size() == 2) {
      const Eigen::Vector2d first = report.covers[0].lowest_rad, second = report.covers[1].highest_rad;
      const auto xi = testing::error_between(report.rig, scene.rig, first, second);
      const double own = squared_mahalanobis(xi, relative_covariance(report.rig, 0, first, 1, second));
      EXPECT_LT(own, 42.7) << seed;  // χ²₆ at 10⁻⁷
      nees += own;
      ++num_solved;
    }
  }
  EXPECT_GE(num_refused, runs / 4);
  ASSERT_GE(num_solved, runs / 4);
  EXPECT_LT(nees / num_solved, 6.0 + 4.0 * std::sqrt(12.0 / num_solved));
}

}  // namespace
}  // namespace alidade
