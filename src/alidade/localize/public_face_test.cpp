#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/room_video.h"

// The whole job through its public header: at once and frame by frame the same, and an answer to every misuse.

namespace alidade {
namespace {

using testing::HoverRun;

HoverRun short_run(int num_frames = 40) {
  testing::Hover scene;
  scene.num_frames = num_frames;
  scene.num_others = 20;
  return testing::hovering(scene, 1);
}

LocalizeConfig config_of(const HoverRun& run) {
  LocalizeConfig config;
  config.target.points = run.target;
  return config;
}

void expect_same(const Localization& a, const Localization& b) {
  ASSERT_EQ(a.path.size(), b.path.size());
  for (std::size_t k = 0; k < a.path.size(); ++k) {
    EXPECT_EQ(a.path[k].event, b.path[k].event) << k;
    EXPECT_EQ(a.path[k].world_from_cam.translation, b.path[k].world_from_cam.translation) << k;
    EXPECT_EQ(a.path[k].cov, b.path[k].cov) << k;
  }
  ASSERT_EQ(a.map.size(), b.map.size());
  for (std::size_t i = 0; i < a.map.size(); ++i) EXPECT_EQ(a.map[i].cov, b.map[i].cov) << i;
  EXPECT_EQ(a.verdict.sentence, b.verdict.sentence);
  EXPECT_EQ(a.nis_per_dof, b.nis_per_dof);
}

TEST(LocalizeFace, FrameByFrameIsAsAtOnce) {
  const HoverRun run = short_run();
  for (const bool has_target : {true, false}) {
    const LocalizeConfig config = has_target ? config_of(run) : LocalizeConfig{};
    const Localization whole = localize(run.frames, run.camera, config, run.truth);
    EXPECT_TRUE(whole.verdict.ok()) << whole.verdict.sentence;
    EXPECT_TRUE(whole.is_smoothed);
    EXPECT_EQ(whole.counts.given, run.frames.size());
    Localizer localizer(run.camera, config);
    for (const ObservationFrame& frame : run.frames) localizer.push(frame);
    expect_same(localizer.finish(run.truth), whole);
    expect_same(localizer.finish(run.truth), whole);  // it changes nothing
  }
}

TEST(LocalizeFace, ImageByImageIsAsAtOnce) {
  testing::RoomScene scene;
  scene.camera = testing::room_camera();
  scene.num_frames = 12;
  std::vector<cv::Mat> images;
  for (const Rigid3& world_from_cam : testing::room_path(scene))
    images.push_back(testing::render_room(scene, world_from_cam, images.size() + 1));
  std::size_t at = 0;
  const NextImage next = [&](cv::Mat& grey, long& frame, double& t_s) {
    if (at == images.size()) return false;
    grey = images[at];
    frame = static_cast<long>(at);
    t_s = static_cast<double>(at++) / scene.rate_hz;
    return true;
  };
  LocalizeConfig config;
  config.target = rectangle_target(scene.rectangle_width_m, scene.rectangle_height_m);
  const Localization whole = localize(ImageStream{next, images.size()}, scene.camera, config);
  EXPECT_EQ(whole.num_lost, 0u);
  Localizer localizer(scene.camera, config);
  for (std::size_t k = 0; k < images.size(); ++k)
    localizer.push(images[k], static_cast<long>(k), static_cast<double>(k) / scene.rate_hz);
  expect_same(localizer.finish(), whole);
  EXPECT_THROW(localizer.push(ObservationFrame{99, 99.0, {}}), ConfigError);
  EXPECT_THROW(localizer.push(cv::Mat(10, 10, CV_8U), 99, 99.0), ConfigError);
  EXPECT_THROW(localizer.push(cv::Mat(), 99, 99.0), ConfigError);
}

std::string fault_of(const LocalizeConfig& config, const Camera& camera = short_run(1).camera) {
  try {
    (void)localize(std::vector<ObservationFrame>{}, camera, config);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(LocalizeFace, AnswersEveryHostileNumber) {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::nan("");
  for (const double bad : {nan, inf, -inf, -1.0}) {
    const auto expect_refused = [&](const auto& member) {
      LocalizeConfig config;
      member(config) = bad;
      EXPECT_NE(fault_of(config), "") << bad;
    };
    expect_refused([](LocalizeConfig & c) -> auto& { return c.depth_m; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.sigma_px; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.sigma_scale; });
    for (double LocalizeConfig::*member : {&LocalizeConfig::sigma_depth, &LocalizeConfig::period_s,
                                           &LocalizeConfig::sigma_speed_m_s, &LocalizeConfig::sigma_rate_rad_s})
      expect_refused([&](LocalizeConfig & c) -> auto& { return c.*member; });
    using Filter = LocalizationFilterConfig;
    for (double Filter::*member :
         {&Filter::sigma_px, &Filter::sigma_new_px, &Filter::sigma_a_m_s2, &Filter::sigma_alpha_rad_s2, &Filter::gate,
          &Filter::curvature_tolerance, &Filter::consensus_above, &Filter::max_rotation_rad, &Filter::linear_below,
          &Filter::sigma_scale})
      expect_refused([&](LocalizeConfig & c) -> auto& { return c.filter.*member; });
    for (double FilterBankConfig::*member :
         {&FilterBankConfig::spread, &FilterBankConfig::narrowed, &FilterBankConfig::min_weight})
      expect_refused([&](LocalizeConfig & c) -> auto& { return c.bank.*member; });
    using Features = ImageFeatureConfig;
    for (double Features::*member :
         {&Features::sigma_floor_px, &Features::min_found_share, &Features::near_share, &Features::near_rad})
      expect_refused([&](LocalizeConfig & c) -> auto& { return c.features.*member; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.target.sigma_scale; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.target.points.emplace_back().sigma_m; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.start.emplace().cov(2, 2); });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.start.emplace().sigma_depth; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.start.emplace().depths.emplace_back().depth_m; });
  }
  for (const int bad : {0, -1, 1 << 30}) {
    const auto expect_refused = [&](const auto& member) {
      LocalizeConfig config;
      member(config) = bad;
      EXPECT_NE(fault_of(config), "") << bad;
    };
    using Features = ImageFeatureConfig;
    for (int Features::*member : {&Features::min_found, &Features::max_tried, &Features::max_features})
      expect_refused([&](LocalizeConfig & c) -> auto& { return c.features.*member; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.bank.splits; });
    expect_refused([](LocalizeConfig & c) -> auto& { return c.filter.max_iterations; });
  }
}

TEST(LocalizeFace, AnswersValuesThatCannotBe) {
  LocalizeConfig config;
  config.new_points = static_cast<NewPoints>(7);
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("new_points is none of inverse-depth|xyz|delayed"));
  config = {};
  config.filter.state_capacity = 5;
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("state_capacity"));
  config = {};
  config.filter.lens_params = {99};
  config.filter.sigma_lens_params = {1.0};
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("numbered from 0"));
  config = {};
  config.target.points = {{.id = 3}, {.id = 3}};
  EXPECT_EQ(fault_of(config), "the target's point 3 appears twice");
  config = {};
  config.beam.emplace();
  config.beam->direction_in_cam *= 7.0;
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("a direction of length one"));
  config = {};
  config.target.patches = {{.width_px = 3, .height_px = 3, .grey = {1}}};
  EXPECT_NE(fault_of(config), "");
  config = {};
  config.distortion = DistortionVariant::none;
  EXPECT_EQ(fault_of(config, testing::hover::camera_of(testing::HoverLens::fisheye)),
            "--distortion: only a brown lens can be given less than full distortion");
  EXPECT_NE(fault_of({}, Camera{}), "");
  Camera camera = short_run(1).camera;
  const Eigen::VectorXd lens = params(camera.lens);
  camera.cov = -Eigen::MatrixXd::Identity(lens.size(), lens.size());
  EXPECT_THAT(fault_of({}, camera), ::testing::HasSubstr("negative variance"));
  camera.cov.resize(0, 0);
  camera.lens = with_params(camera.lens, -lens);
  EXPECT_THAT(fault_of({}, camera), ::testing::HasSubstr("fx and fy above 0"));
}

TEST(LocalizeFace, AnswersFramesThatCannotBe) {
  const auto fault_with = [](const auto& spoil) -> std::string {
    HoverRun run = short_run(6);
    spoil(run);
    try {
      (void)localize(run.frames, run.camera, config_of(run), run.truth);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(fault_with([](HoverRun&) {}), "");
  EXPECT_NE(fault_with([](HoverRun& run) { run.frames[3].t_s = std::nan(""); }), "");
  EXPECT_EQ(fault_with([](HoverRun& run) { run.frames[3].t_s = 0.0; }), "frame 3 is not after the frame before it");
  EXPECT_NE(fault_with([](HoverRun& run) { run.frames[2].observations[1].px.x() = std::nan(""); }), "");
  EXPECT_NE(fault_with([](HoverRun& run) { run.frames[2].observations[1].sigma_px = -1.0; }), "");
  EXPECT_NE(fault_with([](HoverRun& run) { run.frames[2].observations[1].id = run.frames[2].observations[0].id; }), "");
  EXPECT_NE(fault_with([](HoverRun& run) { run.truth[2].world_from_cam.translation.x() = std::nan(""); }), "");
  EXPECT_EQ(fault_with([](HoverRun& run) { run.frames[2].observations[1].px.x() = 1e300; }), "");  // a mismatch
}

TEST(LocalizeFace, AnswersEmptyInput) {
  const Camera camera = short_run(1).camera;
  EXPECT_EQ(localize(ObservationTable{}, camera).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(Localizer(camera).finish().verdict.exit_code, ExitCode::undetermined);
  EXPECT_THROW((void)localize(ImageStream{}, camera), ConfigError);
  const ImageStream none{[](cv::Mat&, long&, double&) { return false; }};
  EXPECT_EQ(localize(none, camera).verdict.exit_code, ExitCode::undetermined);
  ObservationTable table;
  table.skipped.push_back({"a.csv", 2, "is wrong"});
  EXPECT_EQ(localize(table, camera).counts.given, 1u);
}

}  // namespace
}  // namespace alidade
