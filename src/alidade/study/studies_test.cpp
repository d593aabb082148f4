#include "alidade/study/studies.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/estimation/config_error.h"
#include "alidade/study/study_plan.h"

namespace alidade {
namespace {

template <typename Study>
StudyPlan plan_with(Study study, std::uint64_t seed, std::uint64_t trials) {
  StudyPlan plan;
  plan.header = {Study::name, seed, trials, settings_of(fields_of(study)), {}, {}, false};
  plan.points.push_back(setting_of(study, seed));
  plan.header.quantities = plan.points.front().quantities;
  plan.header.has_bound = plan.points.front().has_bound;
  return plan;
}

/// The lean trial is the estimator of the library: the same log through observe() with method batch gives the same
/// intrinsics and σ to a small part of σ.
TEST(ObserveStudy, IsWhatObserveFinds) {
  const ObserveStudy study;
  const RunTrial run = setting_of(study, 5).make_worker();
  int compared = 0;
  for (std::uint64_t number = 0; number < 20; ++number) {
    TrialResult lean;
    run(number, lean);
    ObserveTrial trial = trial_of(study, 5, number);
    const ObserveReport whole = observe(trial.log, trial.config);
    ASSERT_TRUE(lean.has_estimate);
    ASSERT_GE(whole.quantities.size(), 4U);
    const TrueIntrinsics& truth = trial.log.truth.front();
    for (std::size_t i = 0; i < 4; ++i) {
      const double found = truth[i] + lean.values[i].error;
      // observe() weighs pixels beyond three σ down; with none of these the two are one and the same.
      EXPECT_NEAR(found, whole.quantities[i].value, 0.25 * lean.values[i].sigma) << number << " " << i;
      EXPECT_NEAR(lean.values[i].sigma / lean.values[i].bound, 1.0, 0.12);
      ++compared;
    }
  }
  EXPECT_EQ(compared, 80);
}

/// At the bound, and covered by σ: 4000 trials, figures within three standard errors.
TEST(ObserveStudy, ReachesItsBound) {
  const StudyPlan plan = plan_with(ObserveStudy{}, 1, 4000);
  BlockWorker worker(plan);
  const StudyTally tally = worker.run({0, 4000});
  ASSERT_EQ(tally.estimates, 4000U);
  for (std::size_t i = 0; i < 4; ++i) {
    const QuantityFigures figures = figures_of(tally, i, true);
    EXPECT_NEAR(figures.rms_over_bound, 1.0, 3.0 / std::sqrt(8000.0));
    EXPECT_NEAR(figures.coverage[0], 0.6827, 3.0 * std::sqrt(0.6827 * 0.3173 / 4000.0));
    EXPECT_NEAR(figures.coverage[1], 0.9545, 3.0 * std::sqrt(0.9545 * 0.0455 / 4000.0));
    EXPECT_NEAR(figures.bias / figures.rms, 0.0, 3.5 / std::sqrt(4000.0));
  }
}

/// Every study: blocks in whatever division and order give one tally.
template <typename Study>
void expect_one_tally(const Study& study, std::uint64_t trials) {
  const StudyPlan plan = plan_with(study, 3, trials);
  BlockWorker one(plan), other(plan);
  const StudyTally whole = one.run({0, trials});
  EXPECT_EQ(whole.trials, trials);
  EXPECT_GT(whole.estimates, 0U) << Study::name;
  StudyTally sum;
  for (std::uint64_t end = trials; end > 0;) {
    const std::uint64_t first = end > 3 ? end - 3 : 0;
    sum.add(other.run({first, end}));
    end = first;
  }
  EXPECT_EQ(sum, whole) << Study::name;
}

TEST(Studies, DoNotDependOnTheirDivision) {
  expect_one_tally(ObserveStudy{}, 50);
  expect_one_tally(CalibrateStudy{}, 20);
  expect_one_tally(RangefinderStudy{}, 8);
  expect_one_tally(TrackStudy{}, 8);
  expect_one_tally(LocalizeStudy{}, 5);
}

TEST(StudyPlan, BlocksCoverWhatIsMissingAndNothingElse) {
  StudyHeader header;
  header.trials = 100;
  header.variation = StudyVariation{"photos", {4.0, 6.0, 8.0}};
  for (const int shards : {1, 3, 7, 64, 300, 1000}) {
    std::vector<TrialBlock> all;
    for (int i = 0; i < shards; ++i) {
      for (const TrialBlock& block : blocks_missing(header, Shard{i, shards}.trials_of(header), all, 7)) {
        EXPECT_EQ(block.first / 100, (block.end - 1) / 100);
        EXPECT_LE(block.end - block.first, 7U);
        all.push_back(block);
      }
    }
    EXPECT_FALSE(overlap_of(all));
    std::uint64_t sum = 0;
    for (const TrialBlock& block : all) sum += block.end - block.first;
    EXPECT_EQ(sum, 300U);
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2));
    EXPECT_EQ(blocks_missing(header, {0, 300}, all, 7).size(), 1U);
  }
}

TEST(StudyPlan, VariationsAreReadOrRefused) {
  EXPECT_EQ(variation_from("photos=4:30:2").values.size(), 14U);
  EXPECT_EQ(variation_from("noise=0.1:0.3:0.1").values, (std::vector<double>{0.1, 0.2, 0.3}));
  for (const char* text : {"", "photos", "photos=", "photos=4", "photos=4:30", "photos=4:30:0", "photos=30:4:1",
                           "photos=4:30:2:1", "=1:2:1", "photos=nan:2:1", "photos=1:1e9:1"})
    EXPECT_THROW((void)variation_from(text), ConfigError) << text;
  CalibrateStudy study;
  set_varied(fields_of(study), "photos", 9.0);
  set_varied(fields_of(study), "noise", 0.25);
  EXPECT_EQ(study.photos, 9);
  EXPECT_EQ(study.noise_px, 0.25);
  EXPECT_THROW(set_varied(fields_of(study), "photo", 9.0), ConfigError);
  EXPECT_THROW(set_varied(fields_of(study), "photos", 2.0), ConfigError);
  EXPECT_THROW(set_varied(fields_of(study), "photos", 9.5), ConfigError);
}

}  // namespace
}  // namespace alidade
