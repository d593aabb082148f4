/// Processor times of the servo's loop core, one core: servo_bench [--benchmark_filter=...]
#include <benchmark/benchmark.h>

#include <string>

#include "alidade/loop/servo_loop.h"
#include "alidade/servo/head_servo.h"
#include "run_benchmarks.h"

namespace alidade::bench {
namespace {

/// Steps of one head, filter, search and controller of both axes, on the observations of a recorded run. The goal is 50
/// µs.
void time_steps(benchmark::State& state, ControllerKind kind, const ServoPlant& plant) {
  ServoScene scene = xiahou_servo_scene();
  scene.path.radius_m = 0.3;
  scene.path.period_s = 2.0;
  scene.axes = {ServoAxis{plant}, ServoAxis{plant}};
  ServoConfig config;
  config.controller = kind;
  config.axes = scene.axes;
  const ServoRun run = run_servo(scene, config, 1);
  std::vector<HeadServoInput> inputs;
  for (const ServoRow& row : run.rows) {
    if (row.head != 0) continue;
    HeadServoInput input{row.t_s, row.measured_rad, std::nullopt};
    if (row.is_in_image)
      input.observation = HeadObservation{row.t_s, row.measured_rad, row.error_px + centre_of(scene.heads[0].camera)};
    inputs.push_back(input);
  }
  for (auto _ : state) {
    HeadServo servo(scene.heads[0], config);
    for (const HeadServoInput& input : inputs) benchmark::DoNotOptimize(servo.step(input).command.x());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(inputs.size()));
}

void add_all() {
  for (const ControllerKind kind : controller_kinds) {
    for (const bool is_rate_plant : {false, true}) {
      const ServoPlant plant = is_rate_plant ? ServoPlant(RatePlant{}) : ServoPlant(AnglePlant{});
      if (is_rate_plant && kind == ControllerKind::pi) continue;  // its gains are the angle plant's
      const std::string name =
          "servo/" + std::string(controller_name(kind)) + (is_rate_plant ? "/rate_plant" : "/angle_plant");
      benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) { time_steps(state, kind, plant); });
    }
  }
}

}  // namespace
}  // namespace alidade::bench

int main(int argc, char** argv) { return alidade::bench::run_benchmarks(argc, argv, alidade::bench::add_all); }
