#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/results/calibration_outcome.h"
#include "alidade/results/localize_outcome.h"
#include "alidade/results/observe_outcome.h"
#include "alidade/results/rangefinder_outcome.h"
#include "alidade/results/study_outcome.h"
#include "alidade/results/track_outcome.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/localize_file.h"
#include "alidade/tables/pairs_file.h"
#include "alidade/tables/rotation_log_file.h"
#include "alidade/tables/shots_file.h"
#include "alidade/turned/turned.h"

namespace alidade {

JobOutcome trial_outcome(const ObserveStudy& study, std::uint64_t seed, std::uint64_t number) {
  const ObserveTrial trial = trial_of(study, seed, number);
  JobOutcome outcome = outcome_of(observe(trial.log, trial.config));
  outcome.files.push_back({"log.csv", rotation_log_csv(trial.log)});
  return outcome;
}

JobOutcome trial_outcome(const CalibrateStudy& study, std::uint64_t seed, std::uint64_t number) {
  const CalibrateTrial trial = trial_of(study, seed, number);
  CalibrateConfig config;
  config.model = study.model;
  config.board_shape = study.board_shape;
  JobOutcome outcome = outcome_of(calibrate(trial.views, trial.size, trial.board, config));
  outcome.files.push_back({"truth_camera.yaml", camera_text(trial.truth, CameraFormat::alidade)});
  return outcome;
}

JobOutcome trial_outcome(const RangefinderStudy& study, std::uint64_t seed, std::uint64_t number) {
  RangefinderTrial trial = trial_of(study, seed, number);
  JobOutcome outcome = outcome_of(rangefinder(trial.shots, trial.camera, trial.config));
  std::vector<BoardView> views;
  for (std::size_t i = 0; i < trial.shots.size(); ++i) {
    Shot& shot = trial.shots[i];
    shot.name = "shot_" + std::to_string(i + 1) + ".png";
    if (!shot.board) continue;
    shot.board->photo = shot.name;
    views.push_back(*shot.board);
  }
  outcome.files.push_back({"shots.csv", shots_csv(trial.shots, true)});
  outcome.files.push_back({"corners.csv", corners_csv(views)});
  outcome.files.push_back({"given_camera.yaml", camera_text(trial.camera, CameraFormat::alidade)});
  outcome.files.push_back({"truth_rangefinder.yaml", beam_text(trial.truth, trial.camera, "given_camera.yaml")});
  return outcome;
}

namespace {

JobOutcome track_outcome(const TrackTrial& trial) {
  JobOutcome outcome = outcome_of(track(trial.observations, trial.rig, trial.config, trial.truth));
  outcome.files.push_back({"events.csv", events_csv(trial.observations, trial.rig.heads)});
  outcome.files.push_back({"truth.csv", true_track_csv(trial.truth)});
  outcome.files.push_back({"rig.yaml", rig_text(trial.rig)});
  return outcome;
}

}  // namespace

JobOutcome trial_outcome(const TrackStudy& study, std::uint64_t seed, std::uint64_t number) {
  return track_outcome(trial_of(study, seed, number));
}

JobOutcome trial_outcome(const ChainStudy& study, std::uint64_t seed, std::uint64_t number) {
  if (const auto trial = trial_of(study, seed, number)) return track_outcome(*trial);
  JobOutcome outcome;
  outcome.document.verdict = {State::refused,
                              ExitCode::undetermined,
                              "lenses or rig of this chain have no answer",
                              "look at another trial",
                              {}};
  return outcome;
}

JobOutcome trial_outcome(const TurnedStudy& study, std::uint64_t seed, std::uint64_t number) {
  TurnedTrial trial = trial_of(study, seed, number);
  std::string pairs = pairs_csv(trial.photos);
  JobOutcome outcome = outcome_of(observe_matched(std::move(trial.photos), trial.config));
  outcome.files.push_back({"pairs.csv", std::move(pairs)});
  return outcome;
}

JobOutcome trial_outcome(const LocalizeStudy& study, std::uint64_t seed, std::uint64_t number) {
  const LocalizeTrial trial = trial_of(study, seed, number);
  JobOutcome outcome = outcome_of(localize(trial.frames, trial.camera, trial.config, trial.truth));
  outcome.files.push_back({"features.csv", observations_csv(trial.frames)});
  outcome.files.push_back({"truth.tum", tum_text(trial.truth)});
  outcome.files.push_back({"target.yaml", target_text(trial.config.target.points)});
  outcome.files.push_back({"given_camera.yaml", camera_text(trial.camera, CameraFormat::alidade)});
  if (trial.config.start) outcome.files.push_back({"start.yaml", start_text(*trial.config.start)});
  return outcome;
}

}  // namespace alidade
