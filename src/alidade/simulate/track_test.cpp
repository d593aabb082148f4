#include "alidade/simulate/track.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>

#include "alidade/files/csv.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

TEST(SimulateTrack, ManoeuvreIsThatOfTheReferenceCase) {
  const Csv truth = Csv::read(testing::reference_case("c8_manoeuvre_truth.csv"));
  double worst_m = 0.0;
  for (std::size_t row = 0; row < truth.num_rows(); ++row) {
    const Eigen::Vector3d there(truth.number(row, "x_m"), truth.number(row, "y_m"), truth.number(row, "z_m"));
    worst_m = std::max(worst_m, (manoeuvre_position(truth.number(row, "t_s")) - there).norm());
  }
  EXPECT_EQ(truth.num_rows(), 1101u);
  EXPECT_LT(worst_m, 1e-5);  // the file has 7 decimals and steps of 1 ms
}

TEST(SimulateTrack, NoiseHasItsSigma) {
  TrackScene scene = *track_scenario("A2");
  scene.duration_s = 60.0;
  double sum2_px = 0.0, num = 0.0;
  scene.sigma_encoder_rad = 0.0;  // the reading is then the head's angle
  for (const SimulatedObservation& observation : simulate_track(scene, 5)) {
    const auto seen =
        project(scene.heads[observation.head], observation.pan_tilt_rad, scene.position(observation.t_capture_s));
    ASSERT_TRUE(seen);
    sum2_px += (observation.px - seen->px).squaredNorm();
    num += 2.0;
  }
  EXPECT_NEAR(num, 4804.0, 0.5);
  EXPECT_NEAR(sum2_px / num, 0.25, 4.0 * 0.25 * std::sqrt(2.0 / num));
}

TEST(SimulateTrack, HeadsLagBehindTheirTarget) {
  const auto rms_of = [&](double lag_s) {
    TrackScene scene = *track_scenario("A");
    scene.aiming_lag_s = lag_s;
    double sum2 = 0.0, num = 0.0;
    for (const SimulatedObservation& observation : simulate_track(scene, 1)) {
      if (observation.t_capture_s < 2.0) continue;
      sum2 += (observation.px - Eigen::Vector2d(160.0, 120.0)).squaredNorm();
      num += 1.0;
    }
    return std::sqrt(sum2 / num);
  };
  // An independent simulation of the same heads had 8, 2.6 and 1.0 px, noise included.
  EXPECT_NEAR(rms_of(0.34), 8.0, 0.5);
  EXPECT_NEAR(rms_of(0.1), 2.6, 0.15);
  EXPECT_NEAR(rms_of(0.03), 1.0, 0.15);
}

TEST(SimulateTrack, OcclusionLatencyAndRates) {
  const TrackScene hidden = *track_scenario("D");
  for (const SimulatedObservation& observation : simulate_track(hidden, 1)) {
    EXPECT_FALSE(observation.head == 1 && observation.t_capture_s >= 3.0 && observation.t_capture_s < 5.0);
    EXPECT_FALSE(observation.t_capture_s >= 7.0 && observation.t_capture_s < 7.5);
  }
  for (const SimulatedObservation& observation : simulate_track(*track_scenario("E"), 1))
    EXPECT_NEAR(observation.t_arrival_s - observation.t_capture_s, 0.1, 1e-12);
  std::size_t second = 0;
  for (const SimulatedObservation& observation : simulate_track(*track_scenario("G"), 1)) second += observation.head;
  EXPECT_GT(second, 310u);
  EXPECT_FALSE(track_scenario("H"));
}

TEST(SimulateTrack, TimesRoundedDownAreOfOneImageEach) {
  TrackScene scene = *track_scenario("G");  // 20 and 30 images a second
  scene.faults.time_step_s = 0.04;
  std::array<double, 2> before_s{-1.0, -1.0};
  for (const SimulatedObservation& observation : simulate_track(scene, 1)) {
    const double steps = observation.t_capture_s / 0.04;
    EXPECT_NEAR(steps, std::round(steps), 1e-9);
    EXPECT_NEAR(observation.t_arrival_s, observation.t_capture_s, 1e-12);
    EXPECT_GT(observation.t_capture_s, before_s.at(observation.head) + 0.03);
    before_s.at(observation.head) = observation.t_capture_s;
  }
}

}  // namespace
}  // namespace alidade
