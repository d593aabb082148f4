#include "alidade/servo.h"

#include <fmt/format.h>

#include "alidade/servo/head_servo.h"

namespace alidade {
namespace {

/// A simulated loop is what its scenario says, exactly; what would be off in a real one is tried by mismatch and the
/// grid of robustness.
std::vector<Assumption> assumed_of(const ServoScenario& scenario) {
  const ServoScene& scene = scenario.scene;
  std::vector<Assumption> assumed;
  const auto exact = [&](std::string name, double value) {
    assumed.push_back({.name = std::move(name), .value = value, .sigma = 0.0});
  };
  if (!scene.plant_sigma.is_exact()) {
    const ServoAxis& axis = scene.axes[0];
    const double gain = std::visit([](const auto& plant) { return plant.gain; }, axis.plant);
    assumed.push_back({.name = "plant.gain", .value = gain, .sigma = scene.plant_sigma.gain});
    assumed.push_back({.name = "plant.tau_s", .value = tau_of(axis.plant), .sigma = scene.plant_sigma.tau_s});
    assumed.push_back(
        {.name = "plant.command_delay_s", .value = axis.command_delay_s, .sigma = scene.plant_sigma.command_delay_s});
  }
  exact("plant.gain_factor", scene.mismatch.gain);
  exact("plant.tau_factor", scene.mismatch.tau);
  exact("latency_s", scene.latency_s);
  exact("sigma_px", scene.sigma_px);
  exact("sigma_encoder_rad", scene.sigma_encoder_rad);
  if (scene.intrinsics != LensKnowledge::observed)
    for (const RigHead& head : scene.heads) exact(fmt::format("head{}.camera.fx", head.head.id), focal_of(head.camera));
  return assumed;
}

}  // namespace

ServoResult servo(const ServoScenario& scenario, std::uint64_t first_seed, const Progress& progress,
                  const ServoWatch& watch) {
  require_sense(scenario);
  ServoResult result;
  result.scenario = scenario;
  result.seed = first_seed;
  static_cast<ServoStudy&>(result) = study_servo(scenario, first_seed, progress, watch);
  result.counts.given = result.counts.used = result.trials.size();
  result.verdict = servo_verdict(scenario, result);
  result.assumed = assumed_of(scenario);
  if (result.verdict.exit_code == ExitCode::ok) heed_assumptions(result.assumed, result.verdict);
  return result;
}

}  // namespace alidade
