#include "alidade/track/checks/rig_faults.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"
#include "alidade/track/checks/track_assumed.h"

// Rig files that are off by as much as they say, and by more: what the score tests find.

namespace alidade {
namespace {

constexpr double sigma_m = 0.001, sigma_rad = 0.0005;

/// Scenario C, by two heads or by three side by side.
TrackScene scene_of(std::size_t num_heads) {
  TrackScene scene = *track_scenario("C");
  if (num_heads == 2) return scene;
  RigHead third = scene.heads[1];
  third.head.id = 3;
  third.head.world_from_base.translation += Eigen::Vector3d(1.0, 0.0, 0.0);
  scene.heads.push_back(third);
  scene.rate_hz = {20.0, 20.0, 20.0};
  scene.phase_s = {0.0, 0.01, 0.02};
  return scene;
}

/// Its rig file, whose bases are off by 1 mm and 0.5 mrad, as it says; all else is exact, as it says.
Rig drawn_rig(const TrackScene& scene, std::uint64_t seed) {
  Draws draws(seed);
  Rig rig;
  rig.heads.assign(scene.heads.begin(), scene.heads.end());
  const auto num = num_head_params * static_cast<Eigen::Index>(rig.heads.size());
  rig.cov.setZero(num, num);
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    HeadVector step = HeadVector::Zero();
    for (Eigen::Index k = 0; k < 6; ++k) {
      const double sigma = k < 3 ? sigma_m : sigma_rad;
      step[k] = sigma * draws.normal();
      const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h) + k;
      rig.cov(at, at) = sigma * sigma;
    }
    rig.heads[h].head = retract(rig.heads[h].head, step);
    const Eigen::Index num_lens = params(rig.heads[h].camera.lens).size();
    rig.heads[h].camera.cov.setZero(num_lens, num_lens);
    rig.encoder_errors.push_back({.sigma_zero_rad = 0.0, .sigma_scale = 0.0});
  }
  return rig;
}

std::vector<TargetObservation> as_they_were_taken(std::vector<TargetObservation> observations) {
  std::ranges::stable_sort(observations, {}, &TargetObservation::t_capture_s);
  return observations;
}

/// What is tested of one draw, in `report.faults`.
TrackReport tested(const Rig& rig, const std::vector<TargetObservation>& observations, double sigma_a_m_s2) {
  TrackerConfig config;
  config.errors = rig_uncertainty(rig);
  config.sigma_a_m_s2 = sigma_a_m_s2;
  TrackReport report;
  report.errors_are_counted = true;
  report.faults = rig_faults(observations, rig.heads, config).faults;
  return report;
}

/// z of a right rig is normal. Of up to 84 parameters some eight are independent: mean z² of n draws scatters by
/// √(2 / 8n), and one draw in 150 has a fault.
TEST(RigFaults, OfARightRigAreChance) {
  const int draws = testing::trials(6);
  for (const std::size_t num_heads : {2u, 3u}) {
    const TrackScene scene = scene_of(num_heads);
    double sum = 0.0, num = 0.0, most = 0.0;
    for (int seed = 1; seed <= draws; ++seed) {
      const Rig rig = drawn_rig(scene, static_cast<std::uint64_t>(seed));
      const auto observations = as_they_were_taken(testing::observations_of(scene, static_cast<std::uint64_t>(seed)));
      const TrackReport report = tested(rig, observations, scene.sigma_a_m_s2);
      ASSERT_GT(report.faults.size(), 20u);
      for (const RigFault& fault : report.faults) sum += fault.z * fault.z;
      num += static_cast<double>(report.faults.size());
      most = std::max(most, report.faults.front().z);
    }
    EXPECT_NEAR(sum / num, 1.0, 4.0 * std::sqrt(0.25 / draws));
    EXPECT_LT(most, 4.0);  // one in a thousand
    RecordProperty("mean_z2_of_" + std::to_string(num_heads), std::to_string(sum / num));
    RecordProperty("most_of_" + std::to_string(num_heads), std::to_string(most));
  }
}

struct WrongParameter {
  std::string name;  ///< Of the parameter of head 2.
  std::function<void(Rig&, std::vector<TargetObservation>&)> fault;
  bool three_heads_only = false;  ///< Two heads show it hardly or not at all.
};

const std::vector<WrongParameter>& wrong_parameters() {
  using Observations = std::vector<TargetObservation>;
  const auto lens_off = [](Rig& rig, Eigen::Index k, double factor, double more) {
    Eigen::VectorXd lens = params(rig.heads[1].camera.lens);
    lens[k] = factor * lens[k] + more;
    rig.heads[1].camera.lens = with_params(rig.heads[1].camera.lens, lens);
  };
  static const std::vector<WrongParameter> all{
      {"pan_zero_rad", [](Rig& rig, Observations&) { rig.heads[1].head.encoder.pan_zero_rad += 7.0 * sigma_rad; },
       true},
      {"tilt_zero_rad", [](Rig& rig, Observations&) { rig.heads[1].head.encoder.tilt_zero_rad += 10.0 * sigma_rad; }},
      {"pan_scale", [](Rig& rig, Observations&) { rig.heads[1].head.encoder.pan_scale *= 1.05; }, true},
      {"camera.f",
       [lens_off](Rig& rig, Observations&) {
         lens_off(rig, 0, 1.05, 0.0);
         lens_off(rig, 1, 1.05, 0.0);
       }},
      {"camera.cx", [lens_off](Rig& rig, Observations&) { lens_off(rig, 2, 1.0, 10.0); }, true},
      {"camera.cy", [lens_off](Rig& rig, Observations&) { lens_off(rig, 3, 1.0, 10.0); }},
      {"clock_s",
       [](Rig&, Observations& observations) {
         for (TargetObservation& observation : observations)
           if (observation.head == 1) observation.t_capture_s -= 0.02;
       },
       true}};
  return all;
}

/// A parameter of the second head: that head is named, or is one of those that cannot be told apart.
TEST(RigFaults, AreNamed) {
  const int draws = testing::trials(2);
  for (const std::size_t num_heads : {2u, 3u}) {
    const TrackScene scene = scene_of(num_heads);
    for (const WrongParameter& of : wrong_parameters()) {
      if (of.three_heads_only && num_heads < 3) continue;
      int seen = 0, named = 0, head = 0;
      for (int seed = 1; seed <= draws; ++seed) {
        Rig rig = drawn_rig(scene, static_cast<std::uint64_t>(seed));
        std::vector<TargetObservation> observations = testing::observations_of(scene, static_cast<std::uint64_t>(seed));
        of.fault(rig, observations);
        const TrackReport report = tested(rig, as_they_were_taken(std::move(observations)), scene.sigma_a_m_s2);
        const std::vector<RigFault> alike = alike_per_head(report);
        seen += alike.empty() ? 0 : 1;
        head += std::ranges::count(alike, 1u, &RigFault::head) > 0 ? 1 : 0;
        named += !alike.empty() && fault_text(report).find("head2." + of.name) != std::string::npos ? 1 : 0;
      }
      const std::string what = of.name + " of " + std::to_string(num_heads);
      EXPECT_GE(seen, draws - draws / 20) << what;
      EXPECT_GE(head, draws - draws / 20) << what;
      RecordProperty(what, std::to_string(seen) + " " + std::to_string(head) + " " + std::to_string(named));
    }
  }
}

/// Where the score test prefers one head and a fit another, both are named: of three heads in a row with one wrong
/// focal length the score test alone named another one in 7 of 112 tracks of an independent simulator.
TEST(RigFaults, WhatOnlyOneOfTwoTestsPrefersIsNotNamedAlone) {
  const auto of = [](std::size_t head, double z, double z_refit) {
    RigFault fault;
    fault.name = "camera.f";
    fault.head = head;
    fault.z = z;
    fault.z_refit = z_refit;
    return fault;
  };
  TrackReport report;
  report.faults = {of(1, 10.0, 10.0), of(2, 9.4, 10.3), of(0, 8.0, 8.0)};
  const std::vector<RigFault> alike = alike_per_head(report);
  ASSERT_EQ(alike.size(), 2u);
  EXPECT_EQ(alike[0].head, 1u);
  EXPECT_EQ(alike[1].head, 2u);
}

/// Three heads side by side, half a metre apart, and a target that goes by sines of its own in each draw.
TrackScene drawn_scene(std::uint64_t seed) {
  TrackScene scene = scene_of(3);
  scene.heads[1].head.world_from_base.translation = Eigen::Vector3d(0.5, 0.0, 0.0);
  scene.heads[2].head.world_from_base.translation = Eigen::Vector3d(1.0, 0.0, 0.0);
  scene.duration_s = 20.0;
  Draws draws(seed);
  Eigen::Matrix<double, 3, 4> rate, phase, size;
  for (Eigen::Index k = 0; k < rate.size(); ++k) {
    rate(k) = draws.uniform(0.2, 2.2);
    phase(k) = draws.uniform(0.0, 6.3);
    size(k) = (k % 3 == 1 ? 0.2 : 0.5) / (1.0 + rate(k)) * draws.uniform(0.5, 1.5);
  }
  scene.position = [=](double t_s) {
    Eigen::Vector3d at(0.2, 0.0, 2.3);
    for (Eigen::Index k = 0; k < rate.size(); ++k) at[k % 3] += size(k) * std::sin(rate(k) * t_s + phase(k));
    return at;
  };
  return scene;
}

/// A focal length off by 3 % of one of three: the head is named, or named beside the other, and never another alone.
TEST(RigFaults, OfThreeHeadsNoOtherIsNamedAlone) {
  const int draws = testing::trials(4);
  int seen = 0, other_alone = 0;
  for (int seed = 1; seed <= draws; ++seed) {
    const TrackScene scene = drawn_scene(static_cast<std::uint64_t>(seed));
    const auto wrong = static_cast<std::size_t>(seed % 3);
    Rig rig;
    rig.heads.assign(scene.heads.begin(), scene.heads.end());
    Eigen::VectorXd lens = params(rig.heads[wrong].camera.lens);
    lens.head<2>() /= 1.03;
    rig.heads[wrong].camera.lens = with_params(rig.heads[wrong].camera.lens, lens);
    const auto observations = as_they_were_taken(testing::observations_of(scene, static_cast<std::uint64_t>(seed)));
    TrackReport report;
    report.faults = rig_faults(observations, rig.heads, {}).faults;
    const std::vector<RigFault> alike = alike_per_head(report);
    if (alike.empty()) continue;
    ++seen;
    other_alone += std::ranges::count(alike, wrong, &RigFault::head) == 0 ? 1 : 0;
  }
  EXPECT_GE(2 * seen, draws);
  EXPECT_LE(other_alone, draws / 20);
  RecordProperty("seen", std::to_string(seen));
}

/// Of three heads what is wrong within the plane of their rays is seen: the pan zero of the second, off by 7 of the rig
/// file's σ. Two of eight such tracks were good, and up to 6.3σ off.
TEST(RigFaults, APanZeroOfThreeHeadsIsNotSilent) {
  const int draws = testing::trials(2);
  const TrackScene scene = scene_of(3);
  for (const double off_sigma : {0.0, 7.0}) {
    int good = 0, silent = 0, named = 0;
    double nees = 0.0;
    for (int seed = 1; seed <= draws; ++seed) {
      Rig rig = drawn_rig(scene, static_cast<std::uint64_t>(seed));
      rig.heads[1].head.encoder.pan_zero_rad += off_sigma * sigma_rad;
      const std::vector<TargetObservation> observations =
          testing::observations_of(scene, static_cast<std::uint64_t>(seed));
      FollowConfig config;
      config.tracker.errors = rig_uncertainty(rig);
      config.tracker.sigma_a_m_s2 = scene.sigma_a_m_s2;
      config.find_sigma_a = false;
      const TrackReport report = track_target(observations, rig.heads, config, testing::truth_of(scene));
      Verdict verdict = track_verdict(report, observations, rig.heads, config);
      heed_assumptions(track_assumed(observations, rig, config, report, {}), verdict);
      double worst = 0.0;
      for (const TrackStep& step : report.steps) {
        if (!step.has_belief || step.t_s < 1.5) continue;
        const Eigen::Vector3d error = step.belief.x.head<3>() - scene.position(step.t_s);
        for (int k = 0; k < 3; ++k) worst = std::max(worst, std::abs(error[k]) / std::sqrt(step.belief.P(k, k)));
      }
      const bool says = verdict.sentence.find("head2.pan_zero_rad") != std::string::npos;
      good += verdict.state == State::good ? 1 : 0;
      silent += verdict.state == State::good && worst > 5.0 ? 1 : 0;
      named += says ? 1 : 0;
      nees += report.nees_per_dof / draws;
    }
    EXPECT_EQ(silent, 0) << off_sigma;
    if (off_sigma > 0.0) EXPECT_GE(named, draws - (draws + 4) / 5);
    if (off_sigma == 0.0) EXPECT_GE(good, draws - (draws + 19) / 20);
    EXPECT_LT(nees, 2.5) << off_sigma;  // errors of the rig last: three numbers a draw
    const std::string what = std::to_string(static_cast<int>(off_sigma));
    RecordProperty("of_" + what, std::to_string(good) + " " + std::to_string(silent) + " " + std::to_string(named) +
                                     " " + std::to_string(nees));
  }
}

}  // namespace
}  // namespace alidade
