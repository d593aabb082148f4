#include "alidade/track/checks/lens_over_time.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/simulate/draws.h"
#include "alidade/simulate/track.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

/// A Brown lens with skew, on a head with offsets.
RigHead bent_head() {
  RigHead head = xiahou_rig()[1];
  Eigen::VectorXd values = params(Lens{Calibrated<Brown>{}});
  values.head<10>() << 340.0, 338.0, 161.0, 118.0, 0.7, -0.12, 0.03, 0.001, -0.002, 0.0;
  head.camera.lens = with_params(Lens{Calibrated<Brown>{}}, values);
  head.head.tilt_to_cam_m = {0.01, -0.02, 0.03};
  return head;
}

TEST(ZoomedLens, GoesThereAndBackAndKeepsTheLens) {
  const RigHead head = bent_head();
  const Eigen::Vector4d k(900.0, 890.0, 150.0, 125.0);
  const Zoomed zoomed(head.camera, k);
  Eigen::VectorXd values = params(head.camera.lens);
  values.head<4>() = k;
  values[4] *= 900.0 / 340.0;  // the skew goes with fx
  Camera other = head.camera;
  other.lens = with_params(head.camera.lens, values);
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.1, -0.2, 1.0), Eigen::Vector3d(-0.15, 0.05, 1.0)}) {
    const Eigen::Vector2d own = *project(head.camera, point);
    EXPECT_LT((zoomed.px(own) - *project(other, point)).norm(), 1e-9);
    EXPECT_LT((zoomed.own_px(zoomed.px(own)) - own).norm(), 1e-12);
  }
}

/// Jacobians of an observation under another lens, against differences; and what its errors do.
TEST(ZoomedLens, DerivativesAreThoseOfDifferences) {
  const RigHead head = bent_head();
  const ObservationLens lens{Eigen::Vector4d(900.0, 890.0, 150.0, 125.0), Eigen::Vector4d(0.5, 2.0, 1.5, 3.0)};
  const Eigen::Vector2d readings(0.1, -0.05);
  const ObservationModel see(head, readings, 0.5, 0.001, lens);
  const Eigen::Vector3d position = head.head.world_from_base * Eigen::Vector3d(0.05, 0.1, 1.4);
  const auto seen = see(position);
  ASSERT_TRUE(seen);
  for (int i = 0; i < 3; ++i) {
    constexpr double h = 1e-6;
    Eigen::Vector3d step = Eigen::Vector3d::Zero();
    step[i] = h;
    const Eigen::Vector2d slope = (see(position + step)->z - see(position - step)->z) / (2.0 * h);
    EXPECT_LT((seen->J_z_position.col(i) - slope).norm(), 1e-5 * seen->J_z_position.norm());
  }
  Rig rig;
  rig.heads = {head};
  rig.heads[0].camera.cov.setZero(10, 10);
  rig.heads[0].camera.cov.diagonal().head<4>() << 1.0, 4.0, 9.0, 0.25;
  const RigUncertainty errors = rig_uncertainty(rig);
  const auto effect =
      rig_error_effect(errors.factor[0], see.turned, *see.camera, position, Eigen::Vector3d::Zero(), lens);
  ASSERT_TRUE(effect);
  // The same by hand: own σ, scaled, through the own camera, seen so many times larger.
  const Eigen::Vector4d sigma = Eigen::Vector4d(1.0, 2.0, 3.0, 0.5).cwiseProduct(lens.error_scale);
  const Zoomed zoomed(head.camera, lens.k);
  Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();
  for (int j = 0; j < 4; ++j) {
    constexpr double h = 1e-4;
    Eigen::VectorXd more = params(head.camera.lens), less = more;
    more[j] += h;
    less[j] -= h;
    Camera up = head.camera, down = head.camera;
    up.lens = with_params(up.lens, more);
    down.lens = with_params(down.lens, less);
    const Eigen::Vector3d point = see.turned.point_in_cam(position);
    const Eigen::Vector2d slope = zoomed.ratio.cwiseProduct(*project(up, point) - *project(down, point)) / (2.0 * h);
    cov += sigma[j] * sigma[j] * slope * slope.transpose();
  }
  // Directions below 0.01 px are ignored.
  EXPECT_LT((*effect * effect->transpose() - cov).norm(), 1e-2 * cov.norm());
}

/// Observations of scenario B through lenses that zoom to twice and to half their focal length.
struct ZoomingTrack {
  std::vector<TargetObservation> observations;
  Rig rig;
  TrueTrack truth;
  std::vector<IntrinsicsHistory> histories;
};

/// `off`: by how many σ the given focal lengths are off, of each head.
ZoomingTrack zooming_track(std::uint64_t seed, double sigma_share, const Eigen::Vector2d& off) {
  TrackScene scene = *track_scenario("B");
  ZoomingTrack track;
  track.rig.heads = scene.heads;
  const auto num = num_head_params * static_cast<Eigen::Index>(scene.heads.size());
  track.rig.cov.setZero(num, num);
  track.histories.resize(2);
  for (int k = 0; k <= 100; ++k) {
    const double t_s = 0.1 * k;
    for (std::size_t h = 0; h < 2; ++h) {
      const Eigen::Vector4d own = own_lens(scene.heads[h].camera).k;
      const double factor = std::exp((h == 0 ? 0.7 : -0.7) * std::sin(0.6 * t_s));
      IntrinsicsSample now;
      now.k << factor * own.head<2>(), own.tail<2>();
      now.sigma << sigma_share * now.k.head<2>(), 0.0, 0.0;
      track.histories[h].t_s.push_back(t_s);
      track.histories[h].lens.push_back(now);
    }
  }
  for (IntrinsicsHistory& history : track.histories) history.until_s = 10.0;
  for (const SimulatedObservation& s : simulate_track(scene, seed)) {
    // What was drawn with the own lens, seen larger; the noise too, which is given.
    const IntrinsicsSample now = track.histories[s.head].at(s.t_capture_s);
    const Zoomed zoomed(scene.heads[s.head].camera, now.k);
    TargetObservation observation{s.t_capture_s, s.t_arrival_s, s.head, s.pan_tilt_rad, zoomed.px(s.px), 0.0, {}};
    observation.sigma_px = scene.sigma_px * zoomed.ratio.x();
    track.observations.push_back(observation);
  }
  for (std::size_t h = 0; h < 2; ++h)
    for (IntrinsicsSample& now : track.histories[h].lens)
      now.k.head<2>() *= 1.0 + sigma_share * off[static_cast<Eigen::Index>(h)];
  for (int k = 0; k <= 2000; ++k) {
    track.truth.t_s.push_back(k / 200.0);
    track.truth.position.push_back(scene.position(k / 200.0));
  }
  return track;
}

TrackReport tracked(ZoomingTrack& track, double sigma_a) {
  FollowConfig config;
  config.find_sigma_a = false;
  config.judge = false;
  config.tracker.sigma_a_m_s2 = sigma_a;
  config.tracker.errors = rig_uncertainty(track.rig);
  for (RigHead& head : track.rig.heads) head.camera.width_px = head.camera.height_px = 4000;  // the image has no edge
  return track_target(track.observations, track.rig.heads, config, track.truth);
}

TEST(LensOverTime, IsFollowedAsIfNothingZoomed) {
  const double sigma_a = track_scenario("B")->sigma_a_m_s2;
  ZoomingTrack zooming = zooming_track(3, 0.0, Eigen::Vector2d::Zero()), blind = zooming;
  use_intrinsics_histories(zooming.histories, zooming.observations, zooming.rig);
  const TrackReport known = tracked(zooming, sigma_a), unknown = tracked(blind, sigma_a);
  EXPECT_LT(known.rms_m, 1.1 * known.pcrlb_m);
  EXPECT_LT(known.rms_m, 0.0045);
  EXPECT_GT(unknown.rms_m, 5.0 * known.rms_m);
}

/// σ of the intrinsics is included: persistent errors are covered where they are visible.
TEST(LensOverTime, SigmaOfTheIntrinsicsIsCounted) {
  constexpr int num_runs = 40;
  const double sigma_a = track_scenario("B")->sigma_a_m_s2;
  double counted = 0.0, exact = 0.0;
  for (std::uint64_t run = 1; run <= num_runs; ++run) {
    Draws draws(50 + run);
    const Eigen::Vector2d off = draws.normal2();
    ZoomingTrack zooming = zooming_track(run, 0.02, off), trusting = zooming;
    use_intrinsics_histories(zooming.histories, zooming.observations, zooming.rig);
    for (IntrinsicsHistory& history : trusting.histories)
      for (IntrinsicsSample& now : history.lens) now.sigma.setZero();
    use_intrinsics_histories(trusting.histories, trusting.observations, trusting.rig);
    counted += tracked(zooming, sigma_a).nees_per_dof / num_runs;
    exact += tracked(trusting, sigma_a).nees_per_dof / num_runs;
  }
  EXPECT_GT(counted, 0.6);
  EXPECT_LT(counted, 1.4);
  EXPECT_GT(exact, 1.5 * counted);
  RecordProperty("nees_counted", std::to_string(counted));
  RecordProperty("nees_exact", std::to_string(exact));
}

TEST(LensOverTime, SaysWhichObservationNoCourseTellsOf) {
  ZoomingTrack zooming = zooming_track(3, 0.01, Eigen::Vector2d::Zero());
  EXPECT_FALSE(outside_history(zooming.observations, zooming.histories, 1.0));
  zooming.histories[1].until_s = 4.0;
  const auto outside = outside_history(zooming.observations, zooming.histories, 1.0);
  ASSERT_TRUE(outside);
  EXPECT_EQ(outside->head, 1u);
  EXPECT_GT(outside->t_s, 5.0);
  zooming.histories[1].lens.clear();  // a head without a history
  EXPECT_FALSE(outside_history(zooming.observations, zooming.histories, 1.0));
}

}  // namespace
}  // namespace alidade
