// How well two controllers keep a target in the centre of a delayed image: 05_servo [folder]
#include <alidade/files.h>
#include <alidade/servo.h>

#include <cstdio>

int main(int argc, char** argv) {
  alidade::ServoScenario scenario;  // of Xiahou, Chen & Wu, 2015
  scenario.scene.latency_s = 0.1;
  scenario.controllers = {alidade::ControllerKind::pi, alidade::ControllerKind::mpc};
  scenario.num_seeds = 4;
  scenario.robustness.reset();
  const auto result = alidade::servo(scenario);
  for (const auto& compared : result.comparison) {
    const std::string name(alidade::controller_name(compared.controller));
    std::printf("%-12s %6.2f px RMS, %.0f %% of the time in the central third\n", name.c_str(), compared.figures.rms_px,
                100.0 * compared.figures.central_third);
  }
  std::puts(result.verdict.sentence.c_str());
  if (!result.verdict.ok()) return 1;
  if (argc > 1) alidade::save(alidade::outcome_of(result), argv[1]);
}
