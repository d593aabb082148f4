#include <gtest/gtest.h>

#include "alidade/geometry/degree.h"
#include "alidade/testing/rig_trial.h"

namespace alidade {
namespace {

using testing::rig_trial;
using testing::RigTrial;
using testing::RigTrialSetup;

// Of draws of bench/study_causes.cpp that were ● with 7.8σ, 6.8σ and 5.6σ: a focal length that is half indicated, one
// whose error a backlash of 4.0σ took over, an error within a turn of which each amplitude is small.
TEST(RigByNeed, WhatIsHalfIndicatedIsNotSilent) {
  RigTrialSetup focal, once;
  focal.mistake.focal = 0.01, focal.sigma_lens_px = 0.3, focal.first_lens_only = true;
  once.scene.once_rad = 0.5 * degree;
  for (const auto& [setup, seed] : {std::pair{focal, 7005U}, {focal, 7049U}, {once, 7009U}}) {
    const RigTrial trial = rig_trial(setup, seed);
    EXPECT_FALSE(trial.is_silent()) << seed << ": " << trial.worst_sigmas << "σ: " << trial.verdict.sentence;
  }
}

}  // namespace
}  // namespace alidade
