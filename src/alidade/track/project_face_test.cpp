#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alidade/project.h"
#include "alidade/results/project_outcome.h"

// `project` through its public header: where points and pixels are, and an answer to every misuse.

namespace alidade {
namespace {

Rig two_heads() {
  Rig rig;
  const auto heads = xiahou_rig();
  rig.heads.assign(heads.begin(), heads.end());
  for (RigHead& head : rig.heads) head.head.encoder.sigma_rad = 0.001;
  return rig;
}

Beam beside_the_lens() {
  Beam beam;
  beam.origin_in_cam = {0.05, 0.0, 0.0};
  beam.cov.diagonal() << 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 0.0;
  return beam;
}

TEST(ProjectFace, AReadingIsWhereTheBeamSays) {
  const Camera camera = two_heads().heads[0].camera;
  const BeamProjection result = project_readings(beside_the_lens(), camera, {1.0, 2.0});
  ASSERT_EQ(result.readings.size(), 2u);
  EXPECT_EQ(result.readings[1].point.point_in_cam, Eigen::Vector3d(0.05, 0.0, 2.0));
  ASSERT_TRUE(result.readings[1].pixel);
  EXPECT_LT((result.readings[1].pixel->px - *project(camera, {0.05, 0.0, 2.0})).norm(), 1e-12);
  EXPECT_EQ(result.counts.used, 2u);
  EXPECT_FALSE(result.assumed.empty());
  EXPECT_TRUE(result.verdict.ok());
  EXPECT_EQ(outcome_of(result).files.at(0).name, "points.csv");
  const double by_beam = result.readings[1].point.cov(2, 2);
  const BeamProjection noisy = project_readings(beside_the_lens(), camera, {2.0}, {.sigma_range_m = 0.1});
  EXPECT_GT(noisy.readings[0].point.cov(2, 2), by_beam);
}

TEST(ProjectFace, AnotherCameraThanTheBeamsIsSaid) {
  const Camera camera = two_heads().heads[0].camera;
  Camera other = camera;
  other.width_px = 640;
  const BeamProjection result =
      project_readings(beside_the_lens(), camera, {1.0}, {.own_camera = other, .own_camera_name = "own.yaml"});
  EXPECT_EQ(result.verdict.state, State::care);
  EXPECT_EQ(result.verdict.to_add, "use own.yaml");
  // Where it is of another size, the point is outside the image for that alone.
  Camera small = camera;
  small.lens = with_params(camera.lens, params(camera.lens) * 0.1);
  small.width_px = small.height_px = 32;
  const BeamProjection outside =
      project_readings(beside_the_lens(), small, {0.2}, {.own_camera = camera, .own_camera_name = "own.yaml"});
  EXPECT_EQ(outside.verdict.to_add, "use own.yaml") << outside.verdict.sentence;
}

/// 1280×960, f 600 px: 94° wide.
Camera wide_camera() {
  Camera camera{.width_px = 1280, .height_px = 960, .lens = *make_lens("brown")};
  Eigen::VectorXd lens = Eigen::VectorXd::Zero(10);
  lens << 600.0, 600.0, 639.5, 479.5, 0.0, -0.3, 0.08, 0.0, 0.0, 0.0;
  camera.lens = with_params(camera.lens, lens);
  camera.cov = Eigen::MatrixXd::Zero(10, 10);
  camera.cov.diagonal().head<4>().setConstant(0.25);
  return camera;
}

/// The checks that are not good, by name; "" where the verdict is.
std::string named_by(const Beam& beam, const std::vector<double>& ranges_m) {
  const BeamProjection result = project_readings(beam, wide_camera(), ranges_m);
  std::string names;
  for (const Check& check : result.verdict.checks)
    if (check.state != State::good) names += (names.empty() ? "" : ", ") + check.name;
  EXPECT_EQ(names.empty(), result.verdict.state == State::good);
  return names;
}

/// A reading nearer than the camera sees the beam is no fault of its origin or direction.
TEST(ProjectFace, NearReadingsOutsideTheImageAreToldFromWhereTheBeamIsSeen) {
  const BeamProjection near = project_readings(beside_the_lens(), wide_camera(), {0.02, 0.03});
  EXPECT_NE(near.verdict.sentence.find("outside the image"), std::string::npos) << near.verdict.sentence;
  EXPECT_NE(near.verdict.to_add.find("in the image from 0.0"), std::string::npos) << near.verdict.to_add;
  Beam aside = beside_the_lens();
  aside.direction_in_cam = {0.97, 0.0, std::sqrt(1.0 - 0.97 * 0.97)};
  const BeamProjection far = project_readings(aside, wide_camera(), {2.0});
  EXPECT_NE(far.verdict.to_add.find("check origin"), std::string::npos) << far.verdict.to_add;
  Beam crossing = beside_the_lens();  // it is left of the image first, and right of it far away
  crossing.origin_in_cam.x() = -0.6;
  crossing.direction_in_cam = {0.97, 0.0, std::sqrt(1.0 - 0.97 * 0.97)};
  const BeamProjection both = project_readings(crossing, wide_camera(), {0.05, 5.0});
  EXPECT_NE(both.verdict.to_add.find("check origin"), std::string::npos) << both.verdict.to_add;
  EXPECT_FALSE(project_readings(crossing, wide_camera(), {5e-324}).verdict.to_add.empty());
}

TEST(ProjectFace, WhatIsNotSeenOrOfAnotherUnitIsNamed) {
  const Beam good = beside_the_lens();
  EXPECT_EQ(named_by(good, {0.5, 1.0, 2.0, 30.0}), "");
  Beam through_centre = good;
  through_centre.origin_in_cam.setZero();
  EXPECT_EQ(named_by(through_centre, {1.0, 2.0}), "");
  Beam millimetres = good;
  millimetres.origin_in_cam *= 1000.0;
  EXPECT_EQ(named_by(millimetres, {2.0}), "units, in the image");
  EXPECT_EQ(named_by(good, {2310.0}), "units");
  Beam backwards = good;
  backwards.direction_in_cam = {0.0, 0.0, -1.0};
  EXPECT_EQ(named_by(backwards, {2.0}), "in the image");
  // The polynomial of this lens goes on beyond the image's corner, up to 45000 px.
  for (const double x : {0.9, 0.97}) {
    Beam aside = good;
    aside.direction_in_cam = {x, 0.0, std::sqrt(1.0 - x * x)};
    EXPECT_EQ(named_by(aside, {2.0}), "in the image") << x;
  }
}

TEST(ProjectFace, ASigmaThatIsNotLinearIsNamed) {
  Beam unknown = beside_the_lens();
  unknown.cov.diagonal().head<3>().setConstant(400.0);
  EXPECT_EQ(named_by(unknown, {2.0}), "linear");
  unknown = beside_the_lens();
  unknown.cov.diagonal().segment<2>(3).setConstant(0.5);
  EXPECT_EQ(named_by(unknown, {2.0}), "linear");
  Beam near = beside_the_lens();
  near.origin_in_cam = {0.001, 0.0, -0.998};  // 2 mm before the lens, ± 2 mm
  EXPECT_EQ(named_by(near, {1.0}), "linear");
}

TEST(ProjectFace, ACovarianceThatIsNoneIsRefused) {
  Beam beam = beside_the_lens();  // in pairs it could be one
  beam.cov.topLeftCorner<3, 3>() << 1.0, 0.9, 0.9, 0.9, 1.0, -0.9, 0.9, -0.9, 1.0;
  EXPECT_THROW((void)project_readings(beam, wide_camera(), {1.0}), ConfigError);
  Camera camera = wide_camera();
  camera.cov.topLeftCorner<3, 3>() = beam.cov.topLeftCorner<3, 3>();
  EXPECT_THROW((void)project_readings(beside_the_lens(), camera, {1.0}), ConfigError);
}

TEST(ProjectFace, APointOutsideAHeadsImageIsNamed) {
  Rig rig = two_heads();
  const Eigen::Vector3d point_in_world(0.2, -0.1, 2.0);
  const RigProjection seen = project_rig(rig, {0.1, -0.1}, {0.05}, point_in_world);
  EXPECT_EQ(seen.verdict.sentence.find("not in the image"), std::string::npos) << seen.verdict.sentence;
  rig.heads[0].camera.width_px = static_cast<int>(seen.heads[0].pixel->px.x()) - 1;
  const RigProjection result = project_rig(rig, {0.1, -0.1}, {0.05}, point_in_world);
  EXPECT_EQ(result.verdict.state, State::care);
  EXPECT_NE(result.verdict.sentence.find("not in the image of head 1"), std::string::npos) << result.verdict.sentence;
}

TEST(ProjectFace, HeadsSeeAPoint) {
  const RigProjection result = project_rig(two_heads(), {0.1, -0.1}, {0.05}, Eigen::Vector3d(0.2, -0.1, 2.0));
  ASSERT_EQ(result.heads.size(), 2u);
  ASSERT_TRUE(result.heads[0].pixel && result.heads[1].pixel && result.point_cov);
  EXPECT_EQ(result.heads[1].pan_tilt_rad, Eigen::Vector2d(-0.1, 0.05));
  const Eigen::Vector3d uvw = result.heads[0].M * Eigen::Vector4d(0.2, -0.1, 2.0, 1.0);
  EXPECT_LT((uvw.head<2>() / uvw.z() - result.heads[0].pixel->px).norm(), 1e-6);  // a lens without distortion
  EXPECT_GT((*result.point_cov)(2, 2), (*result.point_cov)(0, 0));                // along the view
  EXPECT_EQ(outcome_of(result).document.counts.given, 2u);
  EXPECT_FALSE(project_rig(two_heads(), {0.0}, {0.0}).point_cov);
  EXPECT_THROW((void)project_rig(two_heads(), {0.0}, {0.0}, Eigen::Vector3d(0.2, std::nan(""), 2.0)), ConfigError);
}

TEST(ProjectFace, AnswersEveryMisuse) {
  const Camera camera = two_heads().heads[0].camera;
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_THROW((void)project_readings(beside_the_lens(), camera, {}), ConfigError);
  EXPECT_THROW((void)project_readings(beside_the_lens(), Camera{.width_px = 0}, {1.0}), ConfigError);
  for (const double bad : {std::nan(""), inf, -inf, -1.0, 1e300}) {
    EXPECT_THROW((void)project_readings(beside_the_lens(), camera, {bad}), ConfigError) << bad;
    EXPECT_THROW((void)project_readings(beside_the_lens(), camera, {1.0}, {.sigma_range_m = bad}), ConfigError) << bad;
    Beam beam = beside_the_lens();
    beam.direction_in_cam.z() = bad;
    if (bad != -1.0) {
      EXPECT_THROW((void)project_readings(beam, camera, {1.0}), ConfigError) << bad;
      EXPECT_THROW((void)project_rig(two_heads(), {bad}, {0.0}), ConfigError) << bad;
      EXPECT_THROW((void)project_rig(two_heads(), {0.0}, {0.0}, Eigen::Vector3d(bad, 0.0, 1.0)), ConfigError) << bad;
    }
  }
  Beam beam = beside_the_lens();
  beam.cov(0, 0) = std::nan("");
  EXPECT_THROW((void)project_readings(beam, camera, {1.0}), ConfigError);
  EXPECT_THROW((void)project_rig(two_heads(), {}, {0.0}), ConfigError);
  EXPECT_THROW((void)project_rig(two_heads(), {0.0, 0.0, 0.0}, {0.0}), ConfigError);
  Rig zooming = two_heads();
  zooming.intrinsics_histories.resize(2);
  EXPECT_THROW((void)project_rig(zooming, {0.0}, {0.0}), ConfigError);
  EXPECT_THROW((void)project_rig(Rig{}, {0.0}, {0.0}), ConfigError);
}

}  // namespace
}  // namespace alidade
