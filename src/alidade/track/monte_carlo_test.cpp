#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <map>

#include "alidade/simulate/draws.h"
#include "alidade/testing/track_sample.h"
#include "alidade/track/track.h"

// Many runs of the scenarios against the figures that they must reach. RMSE: of the position at each arrival, after
// 0.5 s, over all runs.

namespace alidade {
namespace {

using testing::observations_of;
using testing::truth_of;

struct Scores {
  double rmse_mm = 0.0, nees = 0.0;  ///< NEES per degree of freedom.
  double after_mm = 0.0;             ///< From 0.25 s after the last occlusion on.
  double worst_after_mm = 0.0;       ///< Of one run.
  std::size_t without_belief = 0, num = 0;
};

Scores scores_of(const TrackScene& scene, TargetMotion method, int runs, double after_s = 0.0) {
  Scores scores;
  double sum2 = 0.0, nees = 0.0, after2 = 0.0, num_after = 0.0;
  for (int run = 0; run < runs; ++run) {
    TrackerConfig config;
    config.method = method;
    config.sigma_a_m_s2 = scene.sigma_a_m_s2;
    Tracker tracker(scene.heads, config);
    const std::vector<TargetObservation> observations = observations_of(scene, static_cast<std::uint64_t>(run) + 1);
    double run2 = 0.0, num_run = 0.0;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const double now_s = observations[i].t_arrival_s;
      (void)tracker.take(observations[i]);
      if ((i + 1 < observations.size() && observations[i + 1].t_arrival_s < now_s + 1e-9) ||
          now_s < 0.5 + scene.latency_s)
        continue;
      const auto belief = tracker.at(now_s);
      if (!belief) ++scores.without_belief;
      if (!belief) continue;
      const Eigen::Vector3d error = belief->x.head<3>() - scene.position(now_s);
      sum2 += error.squaredNorm();
      nees += error.dot(Eigen::Matrix3d(belief->P.topLeftCorner<3, 3>()).inverse() * error);
      ++scores.num;
      if (now_s < after_s) continue;
      run2 += error.squaredNorm();
      num_run += 1.0;
    }
    after2 += run2;
    num_after += num_run;
    scores.worst_after_mm = std::max(scores.worst_after_mm, 1e3 * std::sqrt(run2 / num_run));
  }
  scores.rmse_mm = 1e3 * std::sqrt(sum2 / static_cast<double>(scores.num));
  scores.nees = nees / (3.0 * static_cast<double>(scores.num));
  scores.after_mm = 1e3 * std::sqrt(after2 / num_after);
  return scores;
}

TEST(TrackMonteCarlo, ReachesItsFiguresInEveryScenario) {
  const std::map<std::string, double> max_mm{{"A", 2.2},  {"A2", 2.2}, {"B", 3.8}, {"C", 52.0},
                                             {"E", 12.5}, {"F", 97.0}, {"G", 54.0}};
  for (const auto& [name, limit_mm] : max_mm) {
    const Scores scores = scores_of(*track_scenario(name), TargetMotion::cv, 40);
    EXPECT_LE(scores.rmse_mm, limit_mm) << name;
    EXPECT_GE(scores.nees, 0.6) << name;
    EXPECT_LE(scores.nees, 1.3) << name;
    EXPECT_EQ(scores.without_belief, 0u) << name;
    RecordProperty("rmse_mm_" + name, std::to_string(scores.rmse_mm));
  }
}

TEST(TrackMonteCarlo, OtherModelsDoAsWellAsTheirReference) {
  // An independent implementation's figures, 150 runs: turn 40.0 and imm 42.7 mm in C, Singer 7.4 to 7.7 mm in E.
  EXPECT_LE(scores_of(*track_scenario("C"), TargetMotion::turn, 150).rmse_mm, 44.0);
  EXPECT_LE(scores_of(*track_scenario("C"), TargetMotion::imm, 150).rmse_mm, 47.0);
  TrackScene late = *track_scenario("E");
  late.sigma_a_m_s2 = 0.5;
  EXPECT_LE(scores_of(late, TargetMotion::singer, 30).rmse_mm, 8.2);
}

TEST(TrackMonteCarlo, NoRunDivergesThroughOcclusions) {
  const Scores scores = scores_of(*track_scenario("D"), TargetMotion::cv, 100, 7.75);
  EXPECT_LE(scores.after_mm, 55.0);
  EXPECT_LE(scores.worst_after_mm, 100.0);  // twice what a run without occlusions has at the most
  EXPECT_EQ(scores.without_belief, 0u);
  RecordProperty("after_mm", std::to_string(scores.after_mm));
}

/// The least RMSE of the paper's filter over its process noise and the weight of cm beside tangents.
double best_of_the_paper_mm(const TrackScene& scene, int runs) {
  const TrueTrack truth = truth_of(scene);
  std::vector<std::vector<TargetObservation>> observations;
  for (int run = 0; run < runs; ++run)
    observations.push_back(observations_of(scene, static_cast<std::uint64_t>(run) + 1));
  double best_m = 1e9;
  for (double process = 1e-5; process < 2e5; process *= 10.0) {
    for (double cm = 1e-3; cm < 2e3; cm *= 10.0) {
      double sum2 = 0.0;
      for (const auto& given : observations) {
        XiahouConfig config{.process_variance = process, .variance_of_cm = cm};
        const TrackReport report = track_target_xiahou(given, scene.heads, config, truth);
        sum2 += report.rms_m * report.rms_m;
      }
      best_m = std::min(best_m, std::sqrt(sum2 / runs));
    }
  }
  return 1e3 * best_m;
}

TEST(TrackMonteCarlo, BeatsThePapersFilterAtItsBest) {
  const std::map<std::string, double> min_ratio{{"A", 8.0}, {"A2", 50.0}, {"B", 25.0}, {"C", 7.0}};
  for (const auto& [name, ratio] : min_ratio) {
    const TrackScene scene = *track_scenario(name);
    const double paper_mm = best_of_the_paper_mm(scene, 5), ours_mm = scores_of(scene, TargetMotion::cv, 20).rmse_mm;
    EXPECT_GE(paper_mm / ours_mm, ratio) << name << ": " << paper_mm << " and " << ours_mm << " mm";
    RecordProperty("ratio_" + name, std::to_string(paper_mm / ours_mm));
  }
}

TEST(TrackMonteCarlo, WithPixelsAndIdealHeadsThePapersFilterIsNearlyAsGood) {
  const TrackScene scene = *track_scenario("A");
  const TrueTrack truth = truth_of(scene);
  double min_m = 1e9;
  for (double process = 1e-8; process < 1.0; process *= 10.0) {
    // Tangents of 0.1° and their reach across 64 cm.
    const XiahouConfig config{
        .process_variance = process, .variance_of_tangent = 3e-6, .variance_of_cm = 0.02, .use_pixels = true};
    double sum2 = 0.0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const double rms_m = track_target_xiahou(observations_of(scene, seed), scene.heads, config, truth).rms_m;
      sum2 += rms_m * rms_m / 10.0;
    }
    min_m = std::min(min_m, std::sqrt(sum2));
  }
  EXPECT_LT(1e3 * min_m, 4.0);  // 1.94 mm where Q and R are tuned more finely; 21 without pixels
}

/// A target that moves as the model says, seen by heads that follow it closely.
TrackScene scene_of_the_model(const Eigen::Vector3d& start, double sigma_a, std::uint64_t seed) {
  TrackScene scene = *track_scenario("A");
  scene.duration_s = 4.0;
  scene.aiming_lag_s = 0.03;
  scene.sigma_a_m_s2 = sigma_a;
  scene.position = drawn_path(start, sigma_a, scene.duration_s, seed);
  return scene;
}

TEST(TrackMonteCarlo, IsAtTheBoundWhereTheModelHolds) {
  struct Case {
    Eigen::Vector3d start;
    double sigma_a;
  };
  for (const Case& given :
       {Case{{0.173, -0.314, 0.636}, 0.06}, Case{{0.2, -0.2, 3.0}, 1.0}, Case{{0.2, -0.2, 5.0}, 1.0}}) {
    double error2 = 0.0, bound2 = 0.0, nees = 0.0, num = 0.0;
    constexpr int runs = 150;
    for (int run = 0; run < runs; ++run) {
      const TrackScene scene = scene_of_the_model(given.start, given.sigma_a, static_cast<std::uint64_t>(run));
      FollowConfig config;
      config.find_sigma_a = false;
      config.warm_up_s = 1.0;
      config.tracker.sigma_a_m_s2 = given.sigma_a;
      config.tracker.start_sigma_v_m_s = 0.1;
      const TrackReport report = track_target(observations_of(scene, static_cast<std::uint64_t>(run) + 500),
                                              scene.heads, config, truth_of(scene));
      ASSERT_TRUE(std::isfinite(report.pcrlb_m));
      error2 += report.rms_m * report.rms_m;
      bound2 += report.pcrlb_m * report.pcrlb_m;
      nees += report.nees_per_dof / runs;
      num += 1.0;
    }
    const double ratio = std::sqrt(error2 / bound2);
    EXPECT_LE(ratio, 1.10) << given.start.transpose() << " bound " << std::sqrt(bound2 / num);
    EXPECT_GE(ratio, 0.90) << given.start.transpose();  // an estimate below the bound would be a wrong bound
    EXPECT_NEAR(nees, 1.0, 0.12);
  }
}

}  // namespace
}  // namespace alidade
