#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/testing/track_sample.h"
#include "alidade/track/checks/track_assumed.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

const Check* check_of(const Verdict& verdict, const std::string& name) {
  const auto found = std::ranges::find(verdict.checks, name, &Check::name);
  return found == verdict.checks.end() ? nullptr : &*found;
}

TEST(TrackVerdict, WhatThrowsAQuarterAwayIsNotConsistent) {
  const TrackScene scene = *track_scenario("B");
  std::vector<TargetObservation> observations = testing::observations_of(scene, 3);
  for (std::size_t i = 20; i < observations.size(); i += 4)  // another thing in the image
    observations[i].px.x() += observations[i].px.x() < 160.0 ? 80.0 : -80.0;
  FollowConfig config;
  config.find_sigma_a = false;
  config.tracker.sigma_a_m_s2 = scene.sigma_a_m_s2;
  const TrackReport report = track_target(observations, scene.heads, config);
  const Verdict verdict = track_verdict(report, observations, scene.heads, config);
  EXPECT_EQ(verdict.state, State::bad) << verdict.sentence;
  const Check* rejected = check_of(verdict, "rejected");
  ASSERT_NE(rejected, nullptr);
  EXPECT_EQ(rejected->state, State::bad);
  EXPECT_NEAR(rejected->value, 0.22, 0.05);
}

/// One head's images come 0.1 s later than the other's.
TEST(TrackVerdict, DoesNotDependOnTheOrderOfArrival) {
  for (const double late_s : {0.06, 0.1, 0.2}) {
    const TrackScene scene = *track_scenario("G");
    std::vector<TargetObservation> observations = testing::observations_of(scene, 4);
    const FollowConfig config;
    const TrackReport in_order = track_target(observations, scene.heads, config);
    for (TargetObservation& observation : observations) observation.t_arrival_s += observation.head == 1 ? late_s : 0.0;
    std::ranges::stable_sort(observations, {}, &TargetObservation::t_arrival_s);
    const TrackReport late = track_target(observations, scene.heads, config);
    EXPECT_EQ(late.num_starts, 1u);
    EXPECT_EQ(late.sigma_a_m_s2, in_order.sigma_a_m_s2);
    EXPECT_NEAR(late.nis_per_dof, in_order.nis_per_dof, 1e-9);
    EXPECT_LT((late.steps.back().belief.x - in_order.steps.back().belief.x).norm(), 1e-9);
    EXPECT_EQ(track_verdict(late, observations, scene.heads, config).state, State::good);
  }
}

TEST(TrackVerdict, NoiseThatIsLargerThanStatedRaisesSigma) {
  TrackScene scene = *track_scenario("A");
  scene.sigma_px = 1.0;
  scene.sigma_encoder_rad = 0.0;
  for (RigHead& head : scene.heads) head.head.encoder.sigma_rad = 1e-6;
  const std::vector<TargetObservation> observations = testing::observations_of(scene, 3);
  FollowConfig config;
  config.tracker.sigma_px = 0.5;
  config.find_sigma_a = config.find_sigma_px = false;
  config.tracker.sigma_a_m_s2 = scene.sigma_a_m_s2;
  const TrackReport report = track_target(observations, scene.heads, config, testing::truth_of(scene));
  EXPECT_GT(report.inflation, 2.0);  // the noise's variance is 4 times the one stated
  EXPECT_LT(report.nees_per_dof, 2.0);
  const Verdict verdict = track_verdict(report, observations, scene.heads, config);
  ASSERT_NE(check_of(verdict, "inflated"), nullptr);
  EXPECT_GE(verdict.state, State::care);
}

/// Heads 0.5 m apart look straight ahead at a point half way between, 2 m off: by hand, as z = B f / (u1 − u2).
TEST(TrackAssumed, TheMeetingOfRaysFollowsTheParameters) {
  std::vector<RigHead> heads;
  for (const RigHead& head : xiahou_rig()) heads.push_back(head);
  const std::vector<HeadReading> readings{{0, {0.0, 0.0}}, {1, {0.0, 0.0}}};
  const auto by = meeting_sensitivity(heads, readings, {0.25, 0.0, 2.0}, Eigen::Vector3d::Zero());
  ASSERT_EQ(by.size(), 2u);
  const double f = 337.84, dz_du = 2.0 * 2.0 / (0.5 * f);
  // A centre given too small by 1 px (p = p̂ + 1) puts the pixel 1 px nearer to the axis: u1 falls, z rises.
  EXPECT_NEAR(by[0](2, num_head_params + 2), dz_du, 1e-6);
  EXPECT_NEAR(by[1](2, num_head_params + 2), -dz_du, 1e-6);
  EXPECT_NEAR(by[0](2, num_head_params), 0.125 * dz_du, 1e-6);  // f: du = x/z
  EXPECT_NEAR(by[1](2, 4), by[0](2, 4) * -1.0, 1e-6);           // both bases rotated alike move nothing
}

TEST(TrackAssumed, WhatIsExactMovesNothingAndWhatIsUnknownDoes) {
  const TrackScene scene = *track_scenario("C");
  const auto observations = testing::observations_of(scene, 2);
  const FollowConfig config;
  const TrackReport report = track_target(observations, scene.heads, config);
  Rig rig;
  rig.heads = scene.heads;
  const auto unknown = track_assumed(observations, rig, config, report, {});
  EXPECT_EQ(assumed_check(unknown).state, State::care);
  rig.cov.setZero(2 * num_head_params, 2 * num_head_params);
  for (RigHead& head : rig.heads) {
    const auto size = params(head.camera.lens).size();
    head.camera.cov.setZero(size, size);
  }
  const auto exact = track_assumed(observations, rig, config, report, {});
  EXPECT_EQ(assumed_check(exact).state, State::good);
  EXPECT_EQ(exact.size(), unknown.size());
  for (const Assumption& what : exact)
    if (what.name.ends_with(".not_tested") || what.name.ends_with(".late_alike"))  // a sentence
      EXPECT_TRUE(std::isnan(what.moves));
    else if (!what.name.starts_with("motion") && what.name != "angles (s)")
      EXPECT_EQ(what.moves, 0.0) << what.name;
}

/// Angles of the image before, of all heads: where these follow the target, it is found where it was then.
TEST(TrackAssumed, AnglesBeforeTheirImagesAreListed) {
  const TrackScene scene = *track_scenario("C");
  const auto observations = testing::observations_of(scene, 2);
  constexpr double delay_s = 0.02;
  std::vector<TargetObservation> late = observations;
  for (TargetObservation& each : late) {
    const TargetObservation *before = nullptr, *after = nullptr;
    for (const TargetObservation& other : observations) {
      if (other.head != each.head) continue;
      if (other.t_capture_s <= each.t_capture_s - delay_s) before = &other;
      if (other.t_capture_s > each.t_capture_s - delay_s && after == nullptr) after = &other;
    }
    if (before == nullptr || after == nullptr) continue;
    const double share =
        (each.t_capture_s - delay_s - before->t_capture_s) / (after->t_capture_s - before->t_capture_s);
    each.pan_tilt_rad = before->pan_tilt_rad + share * (after->pan_tilt_rad - before->pan_tilt_rad);
  }
  const TrackReport right = track_target(observations, scene.heads, {}), wrong = track_target(late, scene.heads, {});
  Rig rig;
  rig.heads = scene.heads;
  const auto assumed = track_assumed(observations, rig, {}, right, {});
  const auto row = std::ranges::find(assumed, "angles (s)", &Assumption::name);
  ASSERT_NE(row, assumed.end());
  double moved2 = 0.0, num = 0.0;
  const Eigen::Index k = row->moved == "x_m" ? 0 : row->moved == "y_m" ? 1 : 2;
  for (std::size_t i = right.steps.size() / 10; i < right.steps.size(); ++i) {
    moved2 += std::pow(wrong.steps[i].belief.x[k] - right.steps[i].belief.x[k], 2);
    num += 1.0;
  }
  EXPECT_NEAR(std::sqrt(moved2 / num) / delay_s, row->moved_by / row->ordinary, 0.35 * row->moved_by / row->ordinary);
  const auto of_row = std::ranges::find(assumed, "angles.late_alike", &Assumption::name);
  ASSERT_NE(of_row, assumed.end());
  EXPECT_NEAR(of_row->ordinary, 0.05, 1e-9);
  EXPECT_NE(of_row->moved.find("angles of one row earlier (50 ms) move it by "), std::string::npos) << of_row->moved;
  EXPECT_TRUE(std::isnan(of_row->moves)) << "a sentence, no alarm";
}

}  // namespace
}  // namespace alidade
