#include <cmath>
#include <utility>

#include "alidade/simulate/track.h"
#include "alidade/study/studies.h"
#include "alidade/study/track_trials.h"
#include "alidade/study/trial_random.h"
#include "alidade/study/word_field.h"

namespace alidade {
namespace {

TrackScene track_scene(const TrackStudy& study) {
  TrackScene scene = *track_scenario(study.scenario);
  scene.duration_s = study.duration_s;
  scene.sigma_px = study.noise_px;
  scene.sigma_encoder_rad = study.noise_rad;
  for (RigHead& head : scene.heads) head.head.encoder.sigma_rad = study.noise_rad;
  return scene;
}

}  // namespace

Rig as_exact(Rig rig) {
  const auto num = num_head_params * static_cast<Eigen::Index>(rig.heads.size());
  rig.cov.setZero(num, num);
  rig.cov_with_lenses.resize(0, 0);
  rig.encoder_errors.clear();
  for (RigHead& head : rig.heads) {
    const Eigen::Index size = params(head.camera.lens).size();
    head.camera.cov.setZero(size, size);
  }
  return rig;
}

void take_end_of_track(const TrackTrial& trial, TrialResult& result) {
  const TargetTrack report = track(trial.observations, trial.rig, trial.config);
  result.state = report.verdict.state;
  if (report.steps.empty() || !report.steps.back().has_belief) return;
  const TrackStep& last = report.steps.back();
  const auto truth = trial.truth.at(last.t_s);
  if (!truth) return;
  result.has_estimate = true;
  for (int i = 0; i < 3; ++i) {
    const double sigma = std::sqrt(last.belief.P(i, i));
    result.values.push_back({last.belief.x[i] - (*truth)[i], sigma, sigma});
  }
}

FieldList fields_of(TrackStudy& study) {
  static const std::vector<std::string> methods{"cv", "singer", "turn", "imm"};
  return {
      {.name = "scenario", .value = one_of(study.scenario, track_scenarios()), .help = "Scenario of simulate track"},
      {.name = "method", .value = one_of(study.method, methods), .help = "Motion model of the target"},
      {.name = "noise_px", .value = &study.noise_px, .help = "σ of a pixel coordinate [px]", .limits = {1e-6, 100.0}},
      {.name = "noise_rad",
       .value = &study.noise_rad,
       .help = "σ of an encoder [rad]",
       .limits = {1e-9, 1.0},
       .option = "--encoder-noise"},
      {.name = "duration_s", .value = &study.duration_s, .help = "Duration of a track [s]", .limits = {0.5, 3600.0}}};
}

TrackTrial trial_of(const TrackStudy& study, std::uint64_t seed, std::uint64_t number) {
  const TrackScene scene = track_scene(study);
  TrackTrial trial;
  for (const SimulatedObservation& s : simulate_track(scene, TrialRandom(seed, TrackStudy::name, number).seed()))
    trial.observations.push_back({s.t_capture_s, s.t_arrival_s, s.head, s.pan_tilt_rad, s.px});
  trial.rig.heads = scene.heads;
  trial.rig = as_exact(std::move(trial.rig));  // the simulated heads are exactly what it says
  for (const Field& field : fields_of(trial.config)) {
    if (field.name == "method") (void)set_field(field, study.method);
  }
  trial.config.sigma_px = study.noise_px;
  trial.config.sigma_a_m_s2 = scene.sigma_a_m_s2;
  constexpr double rate_hz = 200.0;
  for (int k = 0; k <= static_cast<int>((scene.duration_s + 1.0) * rate_hz); ++k) {
    trial.truth.t_s.push_back(k / rate_hz);
    trial.truth.position.push_back(scene.position(k / rate_hz));
  }
  return trial;
}

StudySetting setting_of(const TrackStudy& study, std::uint64_t seed) {
  const RunTrial run = [=](std::uint64_t number, TrialResult& result) {
    take_end_of_track(trial_of(study, seed, number), result);
  };
  return {{{"x_m", "m"}, {"y_m", "m"}, {"z_m", "m"}}, false, [run] { return run; }};
}

}  // namespace alidade
