#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/results/track_outcome.h"
#include "alidade/testing/track_sample.h"
#include "alidade/track.h"
#include "alidade/track/track.h"

// The whole job through its public header: the same track as from the parts and as one observation at a time, and an
// answer to every misuse.

namespace alidade {
namespace {

Rig rig_of(const TrackScene& scene) {
  Rig rig;
  rig.heads.assign(scene.heads.begin(), scene.heads.end());
  return rig;
}

/// Of the first seconds: what is asked here does not take more.
std::vector<TargetObservation> brief_observations(TrackScene scene) {
  scene.duration_s = 3.0;
  return testing::observations_of(scene, 5);
}

TEST(TrackFace, IsTheWholeJob) {
  const TrackScene scene = *track_scenario("B");
  const auto observations = testing::observations_of(scene, 5);
  const TargetTrack result = track(observations, rig_of(scene), {}, testing::truth_of(scene));
  ASSERT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  FollowConfig part;
  part.tracker.errors = rig_uncertainty(rig_of(scene));
  const TrackReport followed = track_target(observations, scene.heads, part);
  ASSERT_EQ(result.steps.size(), followed.steps.size());
  EXPECT_EQ(result.steps.back().belief.x, followed.steps.back().belief.x);
  EXPECT_EQ(result.steps.back().belief.P, followed.steps.back().belief.P);
  EXPECT_EQ(result.status, TrackReport::Status::tracked);
  EXPECT_EQ(result.counts.given, observations.size());
  EXPECT_EQ(result.counts.used, followed.num_used);
  EXPECT_EQ(result.counts.used + result.counts.dropped, result.counts.given);
  EXPECT_LT(result.rms_m, 0.01);
  EXPECT_FALSE(result.assumed.empty());
  const JobOutcome outcome = outcome_of(result);
  EXPECT_EQ(outcome.document.counts.given, observations.size());
  ASSERT_EQ(outcome.files.size(), 1u);
  EXPECT_EQ(outcome.files[0].name, "track.csv");
}

/// One head's images come so much later than the other's: of a recording the order of arrival changes nothing.
TEST(TrackFace, ALateHeadIsWaitedFor) {
  const TrackScene scene = *track_scenario("B");
  auto observations = brief_observations(scene);
  const TargetTrack at_once = track(observations, rig_of(scene), {});
  ASSERT_TRUE(at_once.verdict.ok()) << at_once.verdict.sentence;
  const auto arriving = [&](double late_s) {
    std::vector<TargetObservation> late = observations;
    for (TargetObservation& observation : late)
      if (observation.head == 1) observation.t_arrival_s = observation.t_capture_s + late_s;
    std::ranges::stable_sort(late, {}, &TargetObservation::t_arrival_s);
    return track(late, rig_of(scene), {});
  };
  for (const double late_s : {0.1, 0.4, 1.0}) {
    const TargetTrack late = arriving(late_s);
    // Before anything of that head has come there is no track that the other's observations could be put into.
    const double alone = 20.0 * late_s + 1.0;
    EXPECT_GE(static_cast<double>(late.counts.used), static_cast<double>(at_once.counts.used) - alone) << late_s;
    EXPECT_EQ(late.verdict.state, at_once.verdict.state) << late.verdict.sentence;
    EXPECT_LT((late.steps.back().belief.x - at_once.steps.back().belief.x).norm(), 1e-3) << late_s;
  }
}

/// What the filter says of each observation as it comes is what the whole says of it, to the last digit.
TEST(TrackFace, OneByOneIsTheSame) {
  const TrackScene scene = *track_scenario("G");  // images of both heads come late
  const auto observations = brief_observations(scene);
  for (const TrackMethod method : {TrackMethod::cv, TrackMethod::singer, TrackMethod::turn, TrackMethod::imm,
                                   TrackMethod::ballistic, TrackMethod::xiahou2015}) {
    TrackConfig config{.method = method, .sigma_a_m_s2 = scene.sigma_a_m_s2};
    if (method == TrackMethod::cv) config.smooth_s = 0.2;
    TargetTracker tracker(rig_of(scene), config);
    std::vector<TrackStep> steps;
    for (const TargetObservation& observation : observations) steps.push_back(tracker.push(observation));
    const TargetTrack live = tracker.finish(), batch = track(observations, rig_of(scene), config);
    ASSERT_EQ(live.steps.size(), steps.size());
    for (std::size_t i = 0; i < steps.size(); ++i) {
      EXPECT_EQ(steps[i].event, batch.steps[i].event);
      ASSERT_EQ(steps[i].belief.x, batch.steps[i].belief.x) << i;
      ASSERT_EQ(batch.inflation * steps[i].belief.P, batch.steps[i].belief.P) << i;
      ASSERT_EQ(live.steps[i].belief.P, batch.steps[i].belief.P) << i;
    }
    EXPECT_EQ(live.verdict.sentence, batch.verdict.sentence);
    EXPECT_EQ(live.smoothed.size(), batch.smoothed.size());
    const auto ahead = tracker.at(steps.back().t_s + 0.1);
    EXPECT_EQ(ahead.has_value(), method != TrackMethod::xiahou2015);
  }
}

/// What read_rig() found of a rig's file is heeded by what tracks with it, at once and in a stream.
TEST(TrackFace, ARigInDoubtMakesNoGoodTrack) {
  const TrackScene scene = *track_scenario("B");
  const auto observations = testing::observations_of(scene, 5);
  const TrackConfig config{.sigma_a_m_s2 = scene.sigma_a_m_s2};
  Rig rig = rig_of(scene);
  rig.doubts.emplace_back("rig.yaml: camera.yaml has fx 905, but the rig was calibrated with 900");
  TargetTracker tracker(rig, config);
  for (const TargetObservation& observation : observations) (void)tracker.push(observation);
  for (const Verdict& verdict : {track(observations, rig, config).verdict, tracker.finish().verdict}) {
    EXPECT_EQ(verdict.state, State::care);
    EXPECT_EQ(verdict.checks.back().text, rig.doubts[0]);
    EXPECT_EQ(verdict.checks.back().state, State::care);
  }
}

/// The delay of the angles that --sigma-clock states is in each row as it comes.
TEST(TrackFace, AStreamCountsTheAnglesDelay) {
  const TrackScene scene = *track_scenario("B");
  const auto observations = testing::observations_of(scene, 5);
  const TrackConfig config{.sigma_a_m_s2 = scene.sigma_a_m_s2, .sigma_px = 0.5, .sigma_clock_s = 0.01};
  TargetTracker tracker(rig_of(scene), config);
  const TargetTrack batch = track(observations, rig_of(scene), config);
  ASSERT_EQ(batch.inflation, 1.0);
  double off2 = 0.0, num = 0.0;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const TrackStep step = tracker.push(observations[i]);
    if (!step.has_belief || i < observations.size() / 4) continue;
    for (int k = 0; k < 3; ++k) {
      const double ratio = step.belief.P(k, k) / batch.steps[i].belief.P(k, k);
      off2 += (ratio - 1.0) * (ratio - 1.0), num += 1.0;
    }
  }
  ASSERT_GT(num, 100.0);
  EXPECT_LT(std::sqrt(off2 / num), 0.15);  // rates from what has been read until then
}

/// A stream without end keeps its newest rows: the result is that of the batch call for them, which is reported.
TEST(TrackFace, OfALongStreamTheNewestRowsAreKept) {
  const TrackScene scene = *track_scenario("B");
  const auto observations = testing::observations_of(scene, 5);
  const TrackConfig config{.sigma_a_m_s2 = scene.sigma_a_m_s2, .keep_rows = 100};
  TargetTracker tracker(rig_of(scene), config), whole(rig_of(scene), {.sigma_a_m_s2 = scene.sigma_a_m_s2});
  ASSERT_GT(observations.size(), 2u * 100u);
  for (const TargetObservation& observation : observations) {
    const TrackStep step = tracker.push(observation);
    EXPECT_EQ(step.belief.x, whole.push(observation).belief.x) << "the filter forgets nothing";
  }
  const TargetTrack live = tracker.finish();
  ASSERT_GE(live.observations.size(), 100u);
  ASSERT_LT(live.observations.size(), 200u);
  const std::vector<TargetObservation> newest(observations.end() - static_cast<long>(live.observations.size()),
                                              observations.end());
  EXPECT_EQ(track(newest, rig_of(scene), config).steps.back().belief.x, live.steps.back().belief.x);
  const Check& said = live.verdict.checks.back();
  EXPECT_EQ(said.name, "newest rows");
  EXPECT_THAT(said.text, ::testing::HasSubstr("of " + std::to_string(observations.size()) + " observations"));
}

std::string fault_of(const TrackConfig& config) {
  const TrackScene scene = *track_scenario("B");
  try {
    (void)track(brief_observations(scene), rig_of(scene), config);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(TrackFace, AnswersEveryHostileNumber) {
  const double inf = std::numeric_limits<double>::infinity();
  TrackConfig config;
  const std::size_t num_fields = fields_of(config).size();
  for (std::size_t k = 0; k < num_fields; ++k) {
    for (const double bad : {std::nan(""), inf, -inf, -1.0, 1e300}) {
      config = {};
      const Field field = fields_of(config)[k];
      if (double* const* number = std::get_if<double*>(&field.value)) {
        **number = bad;
      } else if (std::optional<double>* const* some = std::get_if<std::optional<double>*>(&field.value)) {
        **some = bad;
      } else {
        continue;
      }
      EXPECT_THAT(fault_of(config), ::testing::HasSubstr(field.name)) << bad;
    }
  }
}

TEST(TrackFace, AnswersWhatDoesNotFitTogether) {
  using ::testing::HasSubstr;
  EXPECT_THAT(fault_of({.gravity_m_s2 = Eigen::Vector3d(0.0, 9.8, 0.0)}), HasSubstr("--gravity: only with"));
  EXPECT_THAT(fault_of({.method = TrackMethod::imm, .gravity_m_s2 = Eigen::Vector3d(0.0, std::nan(""), 0.0)}),
              HasSubstr("gravity_m_s2"));
  EXPECT_THAT(fault_of({.corrected = true}), HasSubstr("--corrected: only with"));
  EXPECT_THAT(fault_of({.method = TrackMethod::imm, .smooth_s = 0.3}), HasSubstr("--smooth: not for --method imm"));
  EXPECT_THAT(fault_of({.min_depth_m = 30.0}), HasSubstr("--min-depth: is not below --max-depth"));
  EXPECT_NE(fault_of({.method = static_cast<TrackMethod>(17)}), "");
  Rig one = rig_of(*track_scenario("B"));
  one.heads.resize(1);
  EXPECT_THROW((void)track({}, one, {.method = TrackMethod::xiahou2015}), ConfigError);
  EXPECT_THROW((void)TargetTracker(one, {.method = TrackMethod::xiahou2015}), ConfigError);
}

TEST(TrackFace, AnswersRigsAndObservationsThatCannotBe) {
  const TrackScene scene = *track_scenario("B");
  const auto given = brief_observations(scene);
  const double nan = std::nan("");
  const auto refuses = [&](const auto& spoil) {
    auto observations = given;
    Rig rig = rig_of(scene);
    spoil(observations[7], rig);
    EXPECT_THROW((void)track(observations, rig), ConfigError);
    bool is_refused = false;
    try {
      TargetTracker tracker(rig);
      (void)tracker.push(observations[7]);
    } catch (const ConfigError&) {
      is_refused = true;
    }
    EXPECT_TRUE(is_refused);
  };
  refuses([](TargetObservation& one, Rig&) { one.head = 2; });
  refuses([&](TargetObservation& one, Rig&) { one.t_capture_s = nan; });
  refuses([](TargetObservation& one, Rig&) { one.t_arrival_s = one.t_capture_s - 1.0; });
  refuses([&](TargetObservation& one, Rig&) { one.pan_tilt_rad.x() = nan; });
  refuses([&](TargetObservation& one, Rig&) { one.px.y() = nan; });
  refuses([](TargetObservation& one, Rig&) { one.sigma_px = -1.0; });
  refuses([](TargetObservation& one, Rig&) { one.lens = ObservationLens{}; });
  refuses([](TargetObservation&, Rig& rig) { rig.heads.clear(); });
  refuses([](TargetObservation&, Rig& rig) { rig.heads[1].camera.width_px = 0; });
  refuses([&](TargetObservation&, Rig& rig) { rig.heads[0].head.world_from_base.translation.x() = nan; });
  refuses([](TargetObservation&, Rig& rig) { rig.heads[0].head.cam_from_tilt.w() = 3.0; });
  refuses([](TargetObservation&, Rig& rig) { rig.heads[0].head.encoder.pan_scale = 0.0; });
  refuses([](TargetObservation&, Rig& rig) { rig.cov = Eigen::MatrixXd::Identity(3, 3); });
  refuses([](TargetObservation&, Rig& rig) { rig.cov_with_lenses = Eigen::MatrixXd::Identity(3, 3); });
  refuses([](TargetObservation&, Rig& rig) { rig.heads[0].camera.cov = Eigen::MatrixXd::Identity(2, 2); });
  refuses([](TargetObservation&, Rig& rig) { rig.cov = -Eigen::MatrixXd::Identity(48, 48); });
  refuses([](TargetObservation&, Rig& rig) { rig.intrinsics_histories.resize(1); });
  refuses([](TargetObservation&, Rig& rig) { rig.encoder_errors.resize(1); });
  refuses([](TargetObservation&, Rig& rig) { rig.heads[1].head.id = rig.heads[0].head.id; });
  EXPECT_THROW((void)track(given, rig_of(scene), {}, {.t_s = {0.0, 1.0}, .position = {}}), ConfigError);
}

TEST(TrackFace, AnswersEmptyInputAndStops) {
  const TrackScene scene = *track_scenario("B");
  EXPECT_EQ(track({}, Rig{}).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(track({}, rig_of(scene)).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(TargetTracker(rig_of(scene)).finish().verdict.exit_code, ExitCode::undetermined);
  const auto stop = [](std::string_view, std::size_t, std::size_t) { return false; };
  EXPECT_THROW((void)track(brief_observations(scene), rig_of(scene), {}, {}, stop), Interrupted);
}

}  // namespace
}  // namespace alidade
