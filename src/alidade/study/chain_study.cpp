#include <algorithm>

#include "alidade/reproduce/track_trials.h"
#include "alidade/study/chain.h"
#include "alidade/study/studies.h"
#include "alidade/study/track_trials.h"
#include "alidade/study/trial_random.h"

namespace alidade {

FieldList fields_of(ChainStudy& study) {
  return {{.name = "range_m",
           .value = &study.range_m,
           .help = "Range of the target [m]; the heads are 0.5 m apart",
           .limits = {0.5, 50.0}},
          {.name = "photos",
           .value = &study.photos,
           .help = "Number of photos of a 9x6 board, per camera",
           .limits = {8, 200}},
          {.name = "exact", .value = &study.exact, .help = "Tracking treats rig and lenses as exact"}};
}

std::optional<TrackTrial> trial_of(const ChainStudy& study, std::uint64_t seed, std::uint64_t number) {
  const std::uint64_t own = TrialRandom(seed, ChainStudy::name, number).seed();
  const std::optional<Chain> chain = draw_chain(own, study.photos);
  if (!chain) return std::nullopt;
  const TrackScene scene = chain_track_scene(*chain, study.range_m, own + 1);
  TrackTrial trial;
  trial.observations = reproduce::observations_of(scene, own + 1);
  trial.rig = study.exact ? as_exact(chain->rig) : chain->rig;
  trial.config.sigma_px = scene.sigma_px;
  trial.config.max_depth_m = std::max(60.0, 2.0 * study.range_m);
  trial.truth = reproduce::truth_of(scene);
  return trial;
}

StudySetting setting_of(const ChainStudy& study, std::uint64_t seed) {
  const RunTrial run = [=](std::uint64_t number, TrialResult& result) {
    if (const auto trial = trial_of(study, seed, number)) take_end_of_track(*trial, result);
  };
  return {{{"x_m", "m"}, {"y_m", "m"}, {"z_m", "m"}}, false, [run] { return run; }};
}

}  // namespace alidade
