/// Processor times of the tracker, one core: track_bench [--benchmark_filter=...]
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "alidade/simulate/track.h"
#include "alidade/track/tracker.h"
#include "run_benchmarks.h"

namespace alidade::bench {
namespace {

/// Heads, lenses and encoders known as a calibration knows them: 32 directions of error, as many as are ever counted.
RigUncertainty calibrated(const std::vector<RigHead>& heads) {
  Rig rig;
  rig.heads = heads;
  const auto num = num_head_params * static_cast<Eigen::Index>(heads.size());
  rig.cov = 1e-6 * Eigen::MatrixXd::Identity(num, num);
  for (RigHead& head : rig.heads) {
    const Eigen::Index size = params(head.camera.lens).size();
    head.camera.cov.setZero(size, size);
    head.camera.cov.diagonal().head<4>().setOnes();
  }
  return rig_uncertainty(rig, 1e-3);
}

/// Observations a second, as a camera would give them: gates, history and all. items/s is what the goal speaks of.
void time_observations(benchmark::State& state, const std::string& scenario, TargetMotion method, bool counts) {
  const TrackScene scene = *track_scenario(scenario);
  std::vector<TargetObservation> observations;
  for (const SimulatedObservation& s : simulate_track(scene, 1))
    observations.push_back({s.t_capture_s, s.t_arrival_s, s.head, s.pan_tilt_rad, s.px});
  TrackerConfig config;
  config.method = method;
  config.sigma_a_m_s2 = scene.sigma_a_m_s2;
  if (counts) config.errors = calibrated(scene.heads);
  state.counters["errors"] = config.errors.num();
  for (auto _ : state) {
    Tracker tracker(scene.heads, config);
    for (const TargetObservation& observation : observations)
      benchmark::DoNotOptimize(tracker.take(observation).belief.x[0]);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(observations.size()));
}

void add_all() {
  for (const TargetMotion method : {TargetMotion::cv, TargetMotion::singer, TargetMotion::turn, TargetMotion::imm}) {
    for (const std::string scenario : {"B", "C", "G"}) {
      for (const bool counts : {false, true}) {
        const std::string name = "track/" + std::string(motion_name(method)) + "/" + scenario;
        benchmark::RegisterBenchmark((name + (counts ? "/errors" : "")).c_str(), [=](benchmark::State& state) {
          time_observations(state, scenario, method, counts);
        });
      }
    }
  }
}

}  // namespace
}  // namespace alidade::bench

int main(int argc, char** argv) { return alidade::bench::run_benchmarks(argc, argv, alidade::bench::add_all); }
