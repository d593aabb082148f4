// The whole job from photos as cameras save them: Bayer mosaic, JPEG, speckle, saturated spots, red and green lasers.
// ALIDADE_TEST_TRIALS=20 draws as many logs of each kind, one otherwise.

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/geometry/decompositions.h"
#include "alidade/rangefinder.h"
#include "alidade/simulate/films/spot_photos.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/testing/trials.h"

namespace alidade::saved_photos {
namespace {

struct Job {
  const char* name;
  SpotPhotoConfig photo;
};

std::vector<Job> jobs() {
  SpotPhotoConfig clean, red95, green85, red75;
  red95.is_bayer = green85.is_bayer = red75.is_bayer = true;
  red95.jpeg_quality = 95, green85.jpeg_quality = 85, red75.jpeg_quality = 75;
  red95.speckle = 0.15, green85.speckle = red75.speckle = 0.3;
  green85.laser.colour = LaserColour::green;
  red75.laser.peak = 2000.0;
  return {{"clean", clean}, {"red, JPEG 95", red95}, {"green, JPEG 85", green85}, {"red, JPEG 75", red75}};
}

RangefinderScene scene_of(std::uint64_t seed) {
  RangefinderSceneConfig config = *rangefinder_scenario("reference");
  config.num_shots = 10;
  config.max_range_m = 2.5;
  config.camera.width_px = 640, config.camera.height_px = 480;
  config.camera.lens = with_params(config.camera.lens, Eigen::Matrix<double, 5, 1>(600.0, 600.0, 320.0, 240.0, 0.0));
  return draw_rangefinder_scene(config, seed);
}

/// Shots with photos alone, and the photos.
RangefinderCalibration calibrated(const RangefinderScene& scene, const SpotPhotoConfig& config, bool with_off,
                                  std::uint64_t seed) {
  SpotScene spots{{scene.camera, scene.board, points_in_board(scene.board), scene.cam_from_board},
                  scene.beam.origin_in_cam,
                  scene.beam.direction_in_cam,
                  scene.range_m};
  std::vector<Shot> shots = simulate_shots(scene, {.with_spot = false, .with_board = false}, seed).shots;
  std::vector<cv::Mat> photos;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    SpotPhotoConfig off = config;
    off.is_on = false;
    shots[i].name = shots[i].photo = std::to_string(2 * i);
    if (with_off) shots[i].photo_off = std::to_string(2 * i + 1);
    photos.push_back(render_spot_photo(spots, i, config, seed));
    photos.push_back(with_off ? render_spot_photo(spots, i, off, seed + 1) : cv::Mat());
  }
  RangefinderConfig settings;
  settings.board = scene.board;
  return rangefinder(shots, scene.camera, settings, [&](const std::string& name) { return photos[std::stoul(name)]; });
}

/// Of origin and direction, the most any coordinate is off, in σ.
double worst_of(const RangefinderCalibration& result, const Beam& truth) {
  double worst = 0.0;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double off_m = result.beam.origin_in_cam[i] - truth.origin_in_cam[i];
    const double off = result.beam.direction_in_cam[i] - truth.direction_in_cam[i];
    worst = std::max(worst, std::abs(off_m) / std::sqrt(result.covariance(i, i)));
    worst = std::max(worst, std::abs(off) / std::max(1e-9, std::sqrt(result.covariance(3 + i, 3 + i))));
  }
  return worst;
}

/// Logs of one kind; every second one with photos of the laser off.
struct Logs {
  int num = 0, num_good = 0;
  double worst_good = 0.0;
};

Logs logs_of(const Job& job, int num) {
  Logs logs;
  for (; logs.num < num; ++logs.num) {
    const auto seed = 300 + static_cast<std::uint64_t>(logs.num);
    const RangefinderScene scene = scene_of(seed);
    const RangefinderCalibration result = calibrated(scene, job.photo, logs.num % 2 == 1, seed);
    if (!result.verdict.ok()) continue;
    ++logs.num_good;
    logs.worst_good = std::max(logs.worst_good, worst_of(result, scene.beam));
  }
  return logs;
}

TEST(RangefinderSavedPhotos, NoGoodVerdictIsWrong) {
  for (const Job& job : jobs()) {
    const Logs logs = logs_of(job, alidade::testing::trials(1));
    std::printf("  %s: %d of %d good, off by at most %.1f sigma\n", job.name, logs.num_good, logs.num, logs.worst_good);
    EXPECT_LT(logs.worst_good, 5.0) << job.name;
    if (job.photo.jpeg_quality == 0) EXPECT_GE(20 * logs.num_good, 19 * logs.num) << job.name;
  }
}

}  // namespace
}  // namespace alidade::saved_photos
