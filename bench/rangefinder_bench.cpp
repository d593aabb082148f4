/// Processor times of the rangefinder's calibration: rangefinder_bench [--benchmark_filter=...]
#include <benchmark/benchmark.h>

#include "alidade/rangefinder/next_shot.h"
#include "alidade/rangefinder/rangefinder.h"
#include "alidade/simulate/rangefinder.h"
#include "run_benchmarks.h"

namespace alidade::bench {
namespace {

/// From corners, spots and readings to the beam with covariance: boards' poses, start, outliers, refinement. Where σ is
/// not given, wrong shots are always looked for, and σ and beam are found in turn.
void time_solve(benchmark::State& state, RangefinderMethod method, Refine refine, bool tells_sigma) {
  RangefinderSceneConfig scene_config = *rangefinder_scenario("reference");
  scene_config.num_shots = static_cast<int>(state.range(0));
  const RangefinderScene scene = draw_rangefinder_scene(scene_config, 1);
  const std::vector<Shot> shots = simulate_shots(scene, {}, 2).shots;
  const std::vector<Eigen::Vector3d> points = points_in_board(scene.board);
  RangefinderConfig config;
  config.method = method;
  config.refine = refine;
  if (tells_sigma) {
    config.sigma_spot_px = 0.3;
    config.sigma_range_m = 0.002;
  }
  for (auto _ : state) {
    const RangefinderReport report = calibrate_rangefinder(shots, points, scene.camera, config);
    if (report.status != RangefinderReport::Status::converged) state.SkipWithError("no beam");
    benchmark::DoNotOptimize(report.cost);
  }
}

void time_plan(benchmark::State& state) {
  const RangefinderSceneConfig config = *rangefinder_scenario("reference");
  const BeamNow now{config.beam, config.camera, points_in_board(config.board)};
  for (auto _ : state) benchmark::DoNotOptimize(plan_next_shots(now, {}, 1).data());
}

void add_all() {
  for (const auto& [name, method] :
       std::vector<std::pair<std::string, RangefinderMethod>>{{"spot", RangefinderMethod::spot},
                                                              {"plane", RangefinderMethod::plane},
                                                              {"joint", RangefinderMethod::joint}}) {
    for (const auto& [what, refine] :
         std::vector<std::pair<std::string, Refine>>{{"beam", Refine::beam}, {"all", Refine::all}}) {
      for (const bool tells_sigma : {true, false}) {
        const std::string of = "rangefinder/" + name + "/" + what + (tells_sigma ? "" : "/sigma_from_residuals");
        benchmark::RegisterBenchmark(of.c_str(),
                                     [=, method = method, refine = refine](benchmark::State& state) {
                                       time_solve(state, method, refine, tells_sigma);
                                     })
            ->Arg(18)
            ->MeasureProcessCPUTime()
            ->Unit(benchmark::kMillisecond);
      }
    }
  }
  benchmark::RegisterBenchmark("plan_next_shots/1", time_plan)->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);
}

}  // namespace
}  // namespace alidade::bench

int main(int argc, char** argv) { return alidade::bench::run_benchmarks(argc, argv, alidade::bench::add_all); }
