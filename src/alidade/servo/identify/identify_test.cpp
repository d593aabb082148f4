#include "alidade/servo/identify/identify.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/testing/servo_sample.h"

namespace alidade {
namespace {

using testing::log_of;
using Log = std::vector<ServoSample>;

/// The paper's axis, 83 ms late, with an encoder whose zero is off.
ServoLogScene scene(bool is_chirp, bool is_rate_plant) {
  ServoLogScene scene = testing::late_scene(is_rate_plant);
  scene.is_chirp = is_chirp;
  scene.zero_rad = 0.3;
  return scene;
}

ServoParams truth_of(const ServoLogScene& scene) {
  ServoParams truth;
  truth << gain_of(scene.axis.plant), tau_of(scene.axis.plant), scene.axis.command_delay_s, scene.zero_rad, 0.0;
  return truth;
}

TEST(ServoResponse, IsWhatTheSimulatedServoDoes) {
  for (const bool is_chirp : {false, true}) {
    for (const bool is_rate_plant : {false, true}) {
      ServoLogScene quiet = scene(is_chirp, is_rate_plant);
      quiet.sigma_rad = 0.0;
      const Log log = log_of(quiet);
      const ServoResponse response =
          servo_response(log, is_rate_plant ? ServoKind::rate : ServoKind::angle, truth_of(quiet));
      for (std::size_t i = 0; i < log.size(); ++i)
        ASSERT_NEAR(response.angle_rad[static_cast<Eigen::Index>(i)], log[i].angle_rad, 1e-12) << i;
    }
  }
}

TEST(ServoResponse, DerivativesAreThoseOfItsValues) {
  for (const bool is_rate_plant : {false, true}) {
    const ServoKind kind = is_rate_plant ? ServoKind::rate : ServoKind::angle;
    const Log log = log_of(scene(true, is_rate_plant));
    ServoParams params = truth_of(scene(true, is_rate_plant));
    params[4] = 0.2;
    params[2] = 0.0834;  // no switch within the step of the difference from any row: there it has a corner
    const ServoResponse response = servo_response(log, kind, params);
    for (int k = 0; k < num_servo_params; ++k) {
      const double step = 1e-5 * std::max(0.01, std::abs(params[k]));
      ServoParams more = params, less = params;
      more[k] += step;
      less[k] -= step;
      const Eigen::VectorXd slope =
          (servo_response(log, kind, more).angle_rad - servo_response(log, kind, less).angle_rad) / (2.0 * step);
      const double size = std::max(1e-6, slope.cwiseAbs().maxCoeff());
      EXPECT_LT((slope - response.J.col(k)).cwiseAbs().maxCoeff(), 1e-6 * size)
          << servo_param_names[static_cast<std::size_t>(k)];
    }
  }
}

/// Without what is counted of modes that are not excited and of an encoder off its centre, which may be far more than
/// the noise's.
Eigen::MatrixXd cov_of_what_may_show(const ServoIdentification& identified) {
  Eigen::MatrixXd cov = identified.fit.cov;
  for (const CountedFlaw& counted : identified.counted)
    if (counted.name == "resonance_share" || counted.name == "encoder_eccentricity_rad")
      cov -= counted.moves * counted.moves.transpose();
  return cov;
}

/// Error² in units of its own covariance is χ² with 5 degrees of freedom, whose mean is 5. This servo has no
/// nonlinearities: with those that the stated covariance includes (a dead band and backlash of typical sizes) it is
/// less.
TEST(IdentifyServo, CoversTheTruth) {
  for (const bool is_rate_plant : {false, true}) {
    for (const bool is_chirp : {false, true}) {
      const ServoLogScene truth = scene(is_chirp, is_rate_plant);
      constexpr int num_runs = 60;
      double sum = 0.0, sum_stated = 0.0;
      int within_one = 0, within_two = 0;
      for (int seed = 1; seed <= num_runs; ++seed) {
        const ServoIdentification found = identify_servo(log_of(truth, static_cast<std::uint64_t>(seed)));
        const ServoFit& fit = found.fit;
        ASSERT_EQ(fit.kind, is_rate_plant ? ServoKind::rate : ServoKind::angle);
        const ServoParams error = fit.params - truth_of(truth);
        sum += squared_mahalanobis(error, fit.cov_model);
        sum_stated += squared_mahalanobis(error, cov_of_what_may_show(found));
        for (int k = 0; k < num_servo_params; ++k) {
          within_one += std::abs(error[k]) < std::sqrt(fit.cov_model(k, k)) ? 1 : 0;
          within_two += std::abs(error[k]) < 2.0 * std::sqrt(fit.cov_model(k, k)) ? 1 : 0;
        }
      }
      EXPECT_NEAR(sum / num_runs, 5.0, 1.4);  // 3.5 σ: χ²₅ has a σ of 3.2, the mean of 60 runs 0.41
      EXPECT_LT(sum_stated / num_runs, 5.0 + 1.4);
      EXPECT_GT(sum_stated / num_runs, 0.4 * 5.0);  // what is added is less than as much again
      // 68.3 and 95.4 % of 300; the five of one log vary together: 3 σ of half as many independent ones.
      EXPECT_NEAR(within_one / (5.0 * num_runs), 0.683, 0.115);
      EXPECT_NEAR(within_two / (5.0 * num_runs), 0.954, 0.052);
    }
  }
}

TEST(IdentifyServo, ReadsRoundedEncodersAndUnevenRows) {
  ServoLogScene rounded = scene(true, false);
  rounded.sigma_rad = 0.0;
  rounded.encoder_step_rad = 0.0015;
  Log log;
  std::size_t i = 0;
  for (const ServoSample& sample : log_of(rounded))
    if (++i % 7 != 3 || log.empty()) log.push_back(sample);
  // A command extended over a missing row is not what was sent: the log has the actual one.
  const ServoIdentification identified = identify_servo(log);
  EXPECT_NEAR(identified.fit.params[0], truth_of(rounded)[0], 0.01 * truth_of(rounded)[0]);
  EXPECT_NEAR(identified.fit.params[1] + identified.fit.params[2], 0.183, 0.005);
  EXPECT_EQ(identify_verdict(log, identified).exit_code, ExitCode::ok);
}

TEST(IdentifyServo, RefusesDegenerateData) {
  const auto refused_as = [](const Log& log, const std::string& what) {
    ServoIdentification identified;
    if (log.size() >= 20) identified = identify_servo(log);
    const Verdict verdict = identify_verdict(log, identified);
    EXPECT_EQ(verdict.exit_code, ExitCode::undetermined) << verdict.sentence;
    EXPECT_NE(verdict.sentence.find(what), std::string::npos) << verdict.sentence;
    EXPECT_FALSE(verdict.to_add.empty());
  };
  ServoLogScene still = scene(false, false);
  still.amplitude = 0.0;
  refused_as(log_of(still), "no excitation");
  Log brief = log_of(scene(false, false));
  brief.resize(12);
  refused_as(brief, "too few");
  Log cut = log_of(scene(false, false));
  cut.resize(59);  // the step acts at 0.583 s
  refused_as(cut, "");
  Log deaf = log_of(scene(false, false));
  Draws draws(5);
  for (ServoSample& sample : deaf) sample.angle_rad = 1e-3 * draws.normal();
  refused_as(deaf, "");
  for (ServoSample& sample : deaf) sample.angle_rad = 0.25;
  refused_as(deaf, "never changes");
}

TEST(IdentifyServo, SaysThatTheServoDoesMore) {
  ServoLogScene swinging = scene(false, false);
  Log log = log_of(swinging);
  for (ServoSample& row : log) row.angle_rad += 0.01 * std::sin(8.0 * row.t_s);  // something else moves it, too
  const Verdict verdict = identify_verdict(log, identify_servo(log));
  EXPECT_EQ(verdict.state, State::care) << verdict.sentence;
  EXPECT_NE(verdict.sentence.find("residuals have structure"), std::string::npos) << verdict.sentence;
}

}  // namespace
}  // namespace alidade
