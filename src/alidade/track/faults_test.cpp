#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"
#include "alidade/track/checks/clock_shift.h"
#include "alidade/track/checks/explanation.h"
#include "alidade/track/checks/track_assumed.h"
#include "alidade/track/track.h"

// What is not as the rig file says: named, or at least not called good.

namespace alidade {
namespace {

struct Judged {
  TrackReport report;
  Verdict verdict;
  double worst_sigma = 0.0;  ///< Largest error of a coordinate in its σ, after the warm-up.
};

/// As `alidade track` judges events by a rig file.
Judged judged_by(const Rig& rig, const TrackScene& scene, std::uint64_t seed, FollowConfig config) {
  const std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
  Judged result;
  result.report = track_target(observations, rig.heads, config);
  result.verdict = track_verdict(result.report, observations, rig.heads, config);
  if (result.verdict.exit_code != ExitCode::ok) return result;
  heed_assumptions(track_assumed(observations, rig, config, result.report, {}), result.verdict);
  for (const TrackStep& step : result.report.steps) {
    if (!step.has_belief || step.t_s < 1.5) continue;
    const Eigen::Vector3d error = step.belief.x.head<3>() - scene.position(step.t_s);
    for (int k = 0; k < 3; ++k)
      result.worst_sigma = std::max(result.worst_sigma, std::abs(error[k]) / std::sqrt(step.belief.P(k, k)));
  }
  return result;
}

/// By a rig file that says nothing of its errors.
Judged judged(const TrackScene& scene, std::uint64_t seed, TargetMotion method = TargetMotion::cv) {
  FollowConfig config;
  config.tracker.method = method;
  Rig rig;
  rig.heads = scene.heads;
  return judged_by(rig, scene, seed, config);
}

TrackScene faulty(const std::string& name, const std::function<void(TrackFaults&)>& fault) {
  TrackScene scene = *track_scenario(name);
  fault(scene.faults);
  return scene;
}

struct FaultCase {
  std::string what;
  std::function<void(TrackFaults&)> fault;
  std::string named;  ///< Words of which one (separated by |) the verdict has to say in most draws; none: unobservable.
};

const std::vector<FaultCase>& fault_cases() {
  static const std::vector<FaultCase> cases{
      {"yaw", [](TrackFaults& f) { f.base_turn_rad.y() = 0.02; }, ""},
      {"pitch", [](TrackFaults& f) { f.base_turn_rad.x() = 0.01; }, "base_rx_rad|tilt"},
      {"roll", [](TrackFaults& f) { f.base_turn_rad.z() = 0.05; }, ""},
      {"baseline", [](TrackFaults& f) { f.baseline = 0.05; }, ""},
      {"pan zero", [](TrackFaults& f) { f.zero_rad[1].x() = 0.02; }, ""},
      {"tilt zero of head 1", [](TrackFaults& f) { f.zero_rad[0].y() = 0.01; }, "base_rx_rad|tilt"},
      {"tilt zero of head 2", [](TrackFaults& f) { f.zero_rad[1].y() = -0.01; }, "base_rx_rad|tilt"},
      {"clock ahead", [](TrackFaults& f) { f.clock_s = 0.04; }, "the clock of head 2"},
      {"clock behind", [](TrackFaults& f) { f.clock_s = -0.04; }, "the clock of head 2"},
      {"clutter", [](TrackFaults& f) { f.clutter = 0.1; }, "rejected|larger than stated"},
      {"swapped", [](TrackFaults& f) { f.swapped = true; }, "heads swapped"},
      {"mirrored", [](TrackFaults& f) { f.mirrored = true; }, "head 2 are mirrored"},
      {"pan sign", [](TrackFaults& f) { f.pan_sign = true; }, "pan of head 2 with the wrong sign"},
      {"tilt sign", [](TrackFaults& f) { f.tilt_sign = true; }, "tilt of head 2 with the wrong sign"}};
  return cases;
}

bool says_one_of(const std::string& sentence, std::string words) {
  for (std::size_t bar; (bar = words.find('|')) != std::string::npos; words.erase(0, bar + 1))
    if (sentence.find(words.substr(0, bar)) != std::string::npos) return true;
  return sentence.find(words) != std::string::npos;
}

TEST(TrackFaults, AreNamedAndNeverCalledGood) {
  const int draws = testing::trials(3);
  for (const char* scenario : {"B", "G"}) {
    for (const FaultCase& of : fault_cases()) {
      const TrackScene scene = faulty(scenario, of.fault);
      int num_named = 0;
      for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(draws); ++seed) {
        const Judged result = judged(scene, seed);
        EXPECT_FALSE(result.verdict.state == State::good && result.worst_sigma > 5.0)
            << scenario << " " << of.what << " " << seed << ": " << result.worst_sigma;
        num_named += !of.named.empty() && says_one_of(result.verdict.sentence, of.named) ? 1 : 0;
        // A late clock is reported for late clocks alone.
        const bool says_clock = result.verdict.sentence.find("clock of head") != std::string::npos;
        if (!of.what.starts_with("clock"))
          EXPECT_FALSE(says_clock) << scenario << " " << of.what << " " << seed << ": " << result.verdict.sentence;
      }
      if (!of.named.empty()) EXPECT_GE(num_named, draws - (draws + 9) / 10) << scenario << " " << of.what;
    }
  }
}

/// By a table whose columns are named as one another, of one head or of both.
TEST(TrackFaults, ExchangedColumnsAreNamed) {
  const auto pixels = [](TargetObservation& row) { std::swap(row.px.x(), row.px.y()); };
  const auto angles = [](TargetObservation& row) { std::swap(row.pan_tilt_rad.x(), row.pan_tilt_rad.y()); };
  for (const char* scenario : {"B", "G"}) {
    const TrackScene scene = *track_scenario(scenario);
    for (const bool is_of_both : {true, false}) {
      const auto named = [&](const auto& exchange) {
        std::vector<TargetObservation> observations = testing::observations_of(scene, 1);
        for (TargetObservation& row : observations)
          if (is_of_both || row.head == 1) exchange(row);
        const TrackReport report = track_target(observations, scene.heads, {});
        const Verdict verdict = track_verdict(report, observations, scene.heads, {});
        EXPECT_EQ(verdict.state, State::refused) << scenario;
        return verdict.sentence;
      };
      const std::string of = is_of_both ? "" : " of head 2";
      EXPECT_NE(named(pixels).find("u and v" + of + " exchanged"), std::string::npos) << scenario << named(pixels);
      EXPECT_NE(named(angles).find("pan and tilt" + of + " exchanged"), std::string::npos) << scenario << named(angles);
    }
  }
}

/// Heads that follow keep the target central, where mirrored images nearly fit: their handedness is looked at before
/// clocks, times and the target's motion.
TEST(TrackFaults, MirroredImagesOfAllHeadsAreNamedFirst) {
  const int draws = testing::trials(10);
  for (const char* scenario : {"A2", "B", "C", "G"}) {
    const TrackScene scene = faulty(scenario, [](TrackFaults& f) { f.mirrored_all = true; });
    int num_named = 0;
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(draws); ++seed) {
      const Judged result = judged(scene, seed);
      const bool is_named = result.verdict.sentence.find("images of all heads are mirrored") != std::string::npos;
      num_named += is_named ? 1 : 0;
      EXPECT_TRUE(is_named) << scenario << " " << seed << ": " << result.verdict.sentence;
      EXPECT_FALSE(result.verdict.ok()) << scenario << " " << seed;
    }
    EXPECT_EQ(num_named, draws) << scenario;
  }
}

TEST(TrackFaults, TimesInMillisecondsAreNamed) {
  for (const char* scenario : {"A2", "B", "C", "E", "G"}) {
    const TrackScene scene = faulty(scenario, [](TrackFaults& f) { f.milliseconds = true; });
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const Verdict verdict = judged(scene, seed).verdict;
      EXPECT_TRUE(verdict.state != State::good) << scenario << " " << seed;
      EXPECT_NE(verdict.sentence.find("are these milliseconds? t_capture_s is in seconds"), std::string::npos)
          << scenario << " " << seed << ": " << verdict.sentence;
      EXPECT_EQ(verdict.to_add, "give t_capture_s and t_arrival_s in seconds") << scenario << " " << seed;
    }
  }
}

/// They were "another head's", and the rest of the track a line to the end of the hours.
TEST(TrackFaults, TimesOfOneHeadInMillisecondsAreNamed) {
  for (const char* scenario : {"A2", "B", "G"}) {
    const TrackScene scene = faulty(scenario, [](TrackFaults& f) { f.milliseconds_of_one = true; });
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      const Verdict verdict = judged(scene, seed).verdict;
      EXPECT_EQ(verdict.state, State::refused) << scenario << " " << seed;
      EXPECT_NE(verdict.sentence.find("are its times milliseconds?"), std::string::npos)
          << scenario << " " << seed << ": " << verdict.sentence;
    }
  }
}

/// It was noise, two targets, times that scatter, or a rig that is not as its file says.
TEST(TrackFaults, ABallThatBouncesIsNamed) {
  const TrackScene scene = *track_scenario("bounce");
  for (const TargetMotion method : {TargetMotion::singer, TargetMotion::ballistic, TargetMotion::imm})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      FollowConfig config;
      config.tracker.method = method;
      config.find_sigma_a = false;  // by an acceleration as large as a bounce's any motion is ordinary
      config.tracker.sigma_a_m_s2 = method == TargetMotion::ballistic ? 0.3 : 10.0;
      const std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
      const TrackReport report = track_target(observations, scene.heads, config, testing::truth_of(scene));
      const Verdict verdict = track_verdict(report, observations, scene.heads, config);
      EXPECT_GE(verdict.state, State::care) << motion_name(method) << " " << seed << ": " << verdict.sentence;
      EXPECT_NE(verdict.sentence.find("as of one that bounces or is struck"), std::string::npos)
          << motion_name(method) << " " << seed << ": " << verdict.sentence;
    }
}

/// Draws of each scenario (ALIDADE_TEST_TRIALS=40: forty), the rig being what its file says, exactly. D hides the
/// target from a head for two seconds, which is reported.
TEST(TrackFaults, CleanScenariosAreGood) {
  const int draws = testing::trials(20);
  for (const char* name : {"A", "A2", "B", "C", "E", "F", "G"}) {
    const TrackScene scene = *track_scenario(name);
    int num_good = 0;
    for (std::uint64_t seed = 101; seed < 101 + static_cast<std::uint64_t>(draws); ++seed) {
      const std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
      const FollowConfig config;
      const TrackReport report = track_target(observations, scene.heads, config, testing::truth_of(scene));
      num_good += track_verdict(report, observations, scene.heads, config).state == State::good ? 1 : 0;
    }
    EXPECT_GE(num_good, draws - draws / 20) << name;
    RecordProperty(std::string("good_") + name, num_good);
  }
}

/// The rig with lenses that are known to 0.3 px, of which one is off by that many pixels in cy.
Rig rig_with_centre_off(const TrackScene& scene, double off_px) {
  Rig rig;
  rig.heads.assign(scene.heads.begin(), scene.heads.end());
  rig.cov.setZero(2 * num_head_params, 2 * num_head_params);
  for (RigHead& head : rig.heads) {
    const Eigen::Index num = params(head.camera.lens).size();
    head.camera.cov.setZero(num, num);
    head.camera.cov.diagonal().head<4>().setConstant(0.09);
  }
  Eigen::VectorXd lens = params(rig.heads[1].camera.lens);
  lens[3] += off_px;
  rig.heads[1].camera.lens = with_params(rig.heads[1].camera.lens, lens);
  return rig;
}

/// A centre that is off by more than its file says is never a good verdict far from the truth; right ones are good.
TEST(TrackFaults, ACentreThatIsOffIsNotSilent) {
  const int draws = testing::trials(1);
  const TrackScene scene = *track_scenario("C");
  for (const double off_px : {0.0, 1.0, 2.0, 3.0, 10.0}) {
    const Rig rig = rig_with_centre_off(scene, off_px);
    FollowConfig config;
    config.tracker.errors = rig_uncertainty(rig);
    int good = 0, silent = 0;
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(draws); ++seed) {
      const Judged result = judged_by(rig, scene, seed, config);
      good += result.verdict.state == State::good ? 1 : 0;
      silent += result.verdict.state == State::good && result.worst_sigma > 5.0 ? 1 : 0;
    }
    EXPECT_EQ(silent, 0) << off_px << " px, of " << draws;
    if (off_px == 0.0) EXPECT_GE(good, draws - draws / 20);
    const std::string px = std::to_string(static_cast<int>(off_px)) + "px";
    RecordProperty("good_" + px, good);
    RecordProperty("silent_" + px, silent);
  }
}

/// A third head, whose row in the rig file is another's, or whose clock is off: the one that is wrong is named, also
/// where it is the first.
TEST(TrackFaults, OfThreeHeadsTheWrongOneIsNamed) {
  TrackScene scene = *track_scenario("C");
  RigHead third = scene.heads[1];
  third.head.id = 3;
  third.head.world_from_base.translation += Eigen::Vector3d(0.1, -0.5, 0.0);
  scene.heads.push_back(third);
  scene.rate_hz = {20.0, 20.0, 20.0};
  scene.phase_s = {0.0, 0.01, 0.02};
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
    const FollowConfig config;
    for (std::size_t wrong = 0; wrong < 3; ++wrong) {
      const std::string head = "head " + std::to_string(scene.heads[wrong].head.id);
      std::vector<RigHead> heads = scene.heads;
      heads[wrong].head.world_from_base.rotation =
          heads[wrong].head.world_from_base.rotation * exp_so3({0.3, 0.4, 0.1});
      const Verdict foreign = track_verdict(track_target(observations, heads, config), observations, heads, config);
      EXPECT_EQ(foreign.exit_code, ExitCode::undetermined);
      EXPECT_NE(foreign.sentence.find("the observations of " + head), std::string::npos) << foreign.sentence;
      const std::vector<TargetObservation> late = with_shift(observations, {wrong, 0.04});
      const Verdict clock = track_verdict(track_target(late, scene.heads, config), late, scene.heads, config);
      EXPECT_NE(clock.sentence.find("the clock of " + head + " seems"), std::string::npos) << clock.sentence;
    }
  }
}

/// Two things in the images, each observed now and then: it is reported, and one of them is tracked.
TEST(TrackFaults, ASecondTargetIsSaid) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const TrackScene scene = faulty("C", [](TrackFaults& f) { f.second = 0.25; });
    const Judged result = judged(scene, seed);
    EXPECT_GE(result.verdict.state, State::care);
    EXPECT_NE(result.verdict.sentence.find("two targets"), std::string::npos) << result.verdict.sentence;
  }
}

/// Of clutter that is let in now and then: σ covers what it does.
TEST(TrackFaults, SigmaCoversWithClutter) {
  for (const double share : {0.05, 0.1, 0.15}) {
    for (const char* name : {"B", "C"}) {
      const TrackScene scene = faulty(name, [share](TrackFaults& f) { f.clutter = share; });
      double nees = 0.0;
      constexpr int draws = 20;
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
        FollowConfig config;
        config.warm_up_s = 1.0;
        nees += track_target(observations, scene.heads, config, testing::truth_of(scene)).nees_per_dof / draws;
      }
      EXPECT_LT(nees, 1.5) << name << " " << share;
      RecordProperty("nees_" + std::string(name) + std::to_string(share), std::to_string(nees));
    }
  }
}

struct Throws {
  double mean_z2 = 0.0, beyond_three = 0.0, num = 0.0;
};

/// Predictions 0.3 s ahead of twenty throws, from 0.15 s after each throw on, both times in flight: the vertical error.
Throws thrown(TargetMotion method) {
  Throws all;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Draws draws(seed);
    const Eigen::Vector3d velocity(draws.uniform(-0.8, 0.8), draws.uniform(-4.5, -3.0), draws.uniform(-0.4, 0.4));
    TrackScene scene = *track_scenario("throw");
    scene.position = thrown_ball({draws.uniform(-0.2, 0.4), draws.uniform(-0.1, 0.3), 3.0}, velocity);
    const double lands_s = 1.0 - 2.0 * velocity.y() / 9.80665;
    FollowConfig config;
    config.tracker.method = method;
    config.predict_s = 0.3;
    for (const PredictedStep& step : track_target(testing::observations_of(scene, seed), scene.heads, config).ahead) {
      if (!step.has_belief || step.t_s < 1.45 || step.t_s > lands_s) continue;
      const double z = (step.belief.x[1] - scene.position(step.t_s).y()) / std::sqrt(step.belief.P(1, 1));
      all.mean_z2 += z * z;
      all.beyond_three += std::abs(z) > 3.0 ? 1.0 : 0.0;
      all.num += 1.0;
    }
  }
  all.mean_z2 /= all.num;
  return all;
}

/// A ball that bounces, followed as if it kept its velocity: named, and what follows it.
TEST(TrackFaults, ATargetThatFallsIsNamed) {
  int named = 0;
  constexpr int draws = 5;
  TrackScene scene = *track_scenario("throw");
  scene.duration_s = 6.0;
  scene.position = [](double t_s) {
    const double flight_s = std::fmod(t_s, 1.0), g = 9.80665;
    return Eigen::Vector3d(0.2 * std::sin(0.8 * t_s), 0.3 - 0.5 * g * flight_s * (1.0 - flight_s), 3.0);
  };
  for (std::uint64_t seed = 1; seed <= draws; ++seed) {
    const Judged result = judged(scene, seed);
    EXPECT_NE(result.verdict.state, State::good) << seed;
    named += result.verdict.sentence.find("--method imm") != std::string::npos;
  }
  EXPECT_GE(named, draws - 1);
}

TEST(TrackFaults, PredictionsInFlightAreWithinTheirSigma) {
  for (const TargetMotion method : {TargetMotion::ballistic, TargetMotion::imm}) {
    const Throws throws = thrown(method);
    EXPECT_GT(throws.num, 400.0);
    EXPECT_LT(throws.mean_z2, 1.2) << motion_name(method);
    EXPECT_LE(throws.beyond_three, 0.01 * throws.num) << motion_name(method);
    RecordProperty("z2_" + std::string(motion_name(method)), std::to_string(throws.mean_z2));
  }
}

}  // namespace
}  // namespace alidade
