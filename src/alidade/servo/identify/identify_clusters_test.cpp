#include "alidade/servo/identify/identify_clusters.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/simulate/servo.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

/// An axis whose encoder's noise goes from row to row as r' = colour r + white, of σ 0.05° in all.
std::vector<ServoSample> coloured_log(double colour, bool is_chirp, std::uint64_t seed) {
  ServoLogScene scene;
  scene.axis.command_delay_s = 0.083;
  scene.is_chirp = is_chirp;
  scene.duration_s = 10.0;
  scene.zero_rad = 0.3;
  const double sigma_rad = scene.sigma_rad;
  scene.sigma_rad = 0.0;
  Draws draws(seed);
  std::vector<ServoSample> log;
  double noise = sigma_rad * draws.normal();
  for (const ServoLogRow& row : simulate_servo_log(scene, seed)) {
    log.push_back({row.t_s, row.command, row.angle_rad + noise});
    noise = colour * noise + std::sqrt(1.0 - colour * colour) * sigma_rad * draws.normal();
  }
  return log;
}

struct Coverage {
  double one = 0.0, two = 0.0, model_two = 0.0;
};

/// σ without what is counted of errors that these logs do not have.
double sigma_of_noise(const ServoIdentification& identified, int param) {
  double variance = identified.fit.cov(param, param);
  for (const CountedFlaw& counted : identified.counted) variance -= counted.moves[param] * counted.moves[param];
  return std::sqrt(variance);
}

/// Over gain, time constant, latency and zero.
Coverage coverage_of(double colour, bool is_chirp, int num_runs) {
  const ServoLogScene scene;
  ServoParams truth;
  truth << gain_of(scene.axis.plant), tau_of(scene.axis.plant), 0.083, 0.3, 0.0;
  Coverage coverage;
  for (int seed = 1; seed <= num_runs; ++seed) {
    const ServoIdentification found = identify_servo(coloured_log(colour, is_chirp, static_cast<std::uint64_t>(seed)));
    const ServoFit& fit = found.fit;
    for (int k = 0; k < 4; ++k) {
      const double error = std::abs(fit.params[k] - truth[k]), share = 1.0 / (4.0 * num_runs);
      coverage.one += error < sigma_of_noise(found, k) ? share : 0.0;
      coverage.two += error < 2.0 * sigma_of_noise(found, k) ? share : 0.0;
      coverage.model_two += error < 2.0 * std::sqrt(fit.cov_model(k, k)) ? share : 0.0;
    }
  }
  return coverage;
}

TEST(IdentifyClusters, SigmaHoldsForWhiteNoise) {
  constexpr int num_runs = 24;
  for (const bool is_chirp : {false, true}) {
    const Coverage coverage = coverage_of(0.0, is_chirp, num_runs);
    EXPECT_NEAR(coverage.two, 0.954, 0.041);
  }
}

TEST(IdentifyClusters, SigmaHoldsForColouredNoise) {
  const int num_runs = testing::trials(20);
  const double least = 0.95 - 3.0 * std::sqrt(0.95 * 0.05 / (2.0 * num_runs));  // of four values half as many count
  for (const bool is_chirp : {false, true}) {
    const Coverage coverage = coverage_of(is_chirp ? 0.5 : 0.9, is_chirp, num_runs);
    EXPECT_GT(coverage.two, least);
    EXPECT_LT(coverage.model_two, 0.9);
  }
}

}  // namespace
}  // namespace alidade
