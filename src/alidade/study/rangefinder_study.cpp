#include <cmath>

#include "alidade/beam/unit_direction.h"
#include "alidade/rangefinder/rangefinder.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/study/studies.h"
#include "alidade/study/trial_random.h"
#include "alidade/study/word_field.h"

namespace alidade {
namespace {

State state_of(RangefinderReport::Status status) {
  if (status == RangefinderReport::Status::converged) return State::good;
  return status == RangefinderReport::Status::no_convergence ? State::not_converged : State::refused;
}

void fill(const RangefinderReport& report, State state, const Beam& truth, TrialResult& result) {
  result.state = state;
  result.has_estimate = report.status == RangefinderReport::Status::converged;
  if (!result.has_estimate) return;
  Eigen::Vector<double, 5> error;
  // The truth in the tangent plane of the estimate, reversed: estimate − truth.
  error << report.beam.origin_in_cam - truth.origin_in_cam,
      -(tangent_basis(report.beam.direction_in_cam).transpose() * truth.direction_in_cam);
  for (Eigen::Index i = 0; i < 5; ++i)
    result.values.push_back({error[i], std::sqrt(report.beam.cov(i, i)), std::sqrt(report.bound.cov(i, i))});
}

}  // namespace

FieldList fields_of(RangefinderStudy& study) {
  static const std::vector<std::string> methods{"spot", "plane", "joint"}, refines{"all", "beam"};
  return {
      {.name = "scenario",
       .value = one_of(study.scenario, rangefinder_scenarios()),
       .help = "Scenario of simulate rangefinder"},
      {.name = "method", .value = one_of(study.method, methods), .help = "spot, plane or joint"},
      {.name = "refine",
       .value = one_of(study.refine, refines),
       .help = "all: refine lens, boards and beam jointly; beam: lens and boards fixed"},
      {.name = "shots", .value = &study.shots, .help = "Shots per log", .limits = {3, 1000}},
      {.name = "noise_px", .value = &study.noise_px, .help = "σ of a spot's coordinate [px]", .limits = {1e-6, 100.0}},
      {.name = "corner_noise_px",
       .value = &study.corner_noise_px,
       .help = "σ of a corner's coordinate [px]",
       .limits = {1e-6, 100.0}},
      {.name = "noise_m",
       .value = &study.noise_m,
       .help = "σ of a reading [m]",
       .limits = {1e-9, 1.0},
       .option = "--range-noise"},
      {.name = "judge",
       .value = &study.judge,
       .help = "Run the whole command with its verdict, not the solver alone; several times slower"}};
}

RangefinderTrial trial_of(const RangefinderStudy& study, std::uint64_t seed, std::uint64_t number) {
  RangefinderSceneConfig scene = *rangefinder_scenario(study.scenario);
  scene.num_shots = study.shots;
  scene.beam.noise = {study.noise_m, 0.0, 0.0};
  const std::uint64_t own = TrialRandom(seed, RangefinderStudy::name, number).seed();
  const RangefinderScene drawn = draw_rangefinder_scene(scene, own);
  RangefinderTrial trial;
  trial.shots =
      simulate_shots(drawn, {.sigma_corner_px = study.corner_noise_px, .sigma_spot_px = study.noise_px}, own + 1).shots;
  // The lens as a calibration knows it: off by its own covariance.
  Draws draws(own + 2);
  trial.camera = scene.camera;
  Eigen::VectorXd values = params(scene.camera.lens);
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] += std::sqrt(scene.camera.cov(i, i)) * draws.normal();
  trial.camera.lens = with_params(scene.camera.lens, values);
  trial.truth = drawn.beam;
  RangefinderConfig& config = trial.config;
  for (const Field& field : fields_of(config)) {
    if (field.name == "method") (void)set_field(field, study.method);
    if (field.name == "refine") (void)set_field(field, study.refine);
  }
  config.board = scene.board;
  config.sigma_spot_px = study.noise_px;
  config.sigma_corner_px = study.corner_noise_px;
  config.sigma_range_m = study.noise_m;
  config.sigma_square_m = config.sigma_scale = 0.0;
  config.rates_next_shots = false;
  return trial;
}

StudySetting setting_of(const RangefinderStudy& study, std::uint64_t seed) {
  const RunTrial run = [=](std::uint64_t number, TrialResult& result) {
    const RangefinderTrial trial = trial_of(study, seed, number);
    if (study.judge) {
      const RangefinderCalibration report = rangefinder(trial.shots, trial.camera, trial.config);
      fill(report, report.verdict.state, trial.truth, result);
    } else {
      const auto report =
          calibrate_rangefinder(trial.shots, points_in_board(*trial.config.board), trial.camera, trial.config);
      fill(report, state_of(report.status), trial.truth, result);
    }
  };
  return {{{"origin_x_m", "m"},
           {"origin_y_m", "m"},
           {"origin_z_m", "m"},
           {"direction_a_rad", "rad"},
           {"direction_b_rad", "rad"}},
          true,
          [run] { return run; }};
}

}  // namespace alidade
