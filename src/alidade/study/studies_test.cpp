#include "alidade/study/studies.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/estimation/config_error.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/study/sigma_map_trials.h"
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
  expect_one_tally(TurnedStudy{}, 4);
  expect_one_tally(ChainStudy{}, 4);
  expect_one_tally(CalibrateStudy{.scenes = 0, .sigma_map = true}, 6);
}

/// Medians of |error| to a hundredth, whatever the signs and sizes; what an estimate has not is in no figure of it.
TEST(StudyTally, KnowsMediansAndWhatIsMissing) {
  StudyTally tally(2), other(2);
  for (std::uint64_t i = 1; i <= 1000; ++i) {
    TrialResult result{State::good, true, {}};
    const double size = static_cast<double>(i * 37 % 1000 + 1) * (i % 2 == 0 ? 1e-4 : -1e-4);
    result.values.push_back({size, 0.01, 0.01});
    result.values.push_back({1e3 * size, i % 4 == 0 ? NAN : 100.0, 1.0});
    (i % 3 == 0 ? tally : other).add(i, result);
  }
  tally.add(other);
  const QuantityFigures one = figures_of(tally, 0, true), two = figures_of(tally, 1, true);
  EXPECT_NEAR(one.median, 0.05005, 5e-4);
  EXPECT_NEAR(one.p90, 0.09005, 9e-4);
  EXPECT_NEAR(one.coverage[0], 0.099, 1e-12);
  EXPECT_EQ(tally.quantities[0].values, 1000U);
  EXPECT_EQ(tally.quantities[1].values, 750U);
  EXPECT_NEAR(two.median, 50.05, 3.0);
  EXPECT_NEAR(two.coverage[0], 749.0 / 750.0, 1e-12);                       // the largest is one σ
  EXPECT_NEAR(static_cast<double>(tally.good_beyond_5_sigma), 500.0, 1.0);  // beyond 0.05
}

/// A camera whose centre is moved sees everything rotated: what remains after the implied rotation is a small part of
/// it, and nothing is left of the truth itself. Another focal length is no rotation.
TEST(SigmaMapTrials, LeaveWhatNoRotationExplains) {
  const Camera truth = *example_camera("pinhole", 640, 480);
  const std::vector<int> free{0, 1, 2, 3};
  const SigmaMapTrials map(truth, free, Eigen::MatrixXd(Eigen::Vector4d(1.0, 1.0, 1.0, 1.0).asDiagonal()));
  const auto errors_of = [&](const Eigen::Vector4d& change) {
    Camera found = truth;
    Eigen::VectorXd values = params(truth.lens);
    values.head<4>() += change;
    found.lens = with_params(truth.lens, values);
    found.cov = Eigen::MatrixXd::Zero(values.size(), values.size());
    found.cov.diagonal().head<4>().setOnes();
    std::vector<TrialValue> all;
    map.add(found, all);
    double largest = 0.0;
    for (const TrialValue& one : all) largest = std::max(largest, std::abs(one.error));
    EXPECT_EQ(all.size(), SigmaMapTrials::quantities().size());
    return largest;
  };
  EXPECT_LT(errors_of(Eigen::Vector4d::Zero()), 1e-9);
  EXPECT_LT(errors_of({0.0, 0.0, 2.0, -2.0}), 1.5);
  EXPECT_GT(errors_of({5.0, 5.0, 0.0, 0.0}), 2.0);
}

/// The σ map is what its pixels' errors scatter by.
TEST(CalibrateStudy, SigmaMapCoversItsErrors) {
  CalibrateStudy study;
  study.sigma_map = true;
  study.scenes = 4;
  const StudyPlan plan = plan_with(study, 11, 300);
  const StudyTally tally = BlockWorker(plan).run({0, 300});
  ASSERT_GE(tally.estimates, 295U);
  double inside1 = 0.0, inside2 = 0.0, count = 0.0;
  for (std::size_t i = 9; i < tally.quantities.size(); ++i) {
    inside1 += static_cast<double>(tally.quantities[i].inside[0]);
    inside2 += static_cast<double>(tally.quantities[i].inside[1]);
    count += static_cast<double>(tally.quantities[i].values);
  }
  EXPECT_EQ(tally.quantities.size(), 29U);
  // Pixels of one calibration are correlated, equivalent to some five independent ones.
  EXPECT_NEAR(inside1 / count, 0.6827, 3.0 * std::sqrt(0.6827 * 0.3173 / 1500.0));
  EXPECT_NEAR(inside2 / count, 0.9545, 3.0 * std::sqrt(0.9545 * 0.0455 / 1500.0));
}

/// With rig and lenses taken as exact the same errors are there, and σ knows nothing of them.
TEST(ChainStudy, CountsTheChain) {
  const auto figures = [](bool is_exact) {
    const StudyPlan plan = plan_with(ChainStudy{.range_m = 6.0, .photos = 13, .exact = is_exact}, 2, 8);
    const StudyTally tally = BlockWorker(plan).run({0, 8});
    EXPECT_GE(tally.estimates, 7U);
    return figures_of(tally, 2, false);
  };
  const QuantityFigures counted = figures(false), exact = figures(true);
  EXPECT_LT(exact.rms_sigma, 0.9 * counted.rms_sigma);
  EXPECT_GT(exact.rms_over_bound, counted.rms_over_bound);
  EXPECT_LT(counted.rms_over_bound, 1.0 + 3.0 / std::sqrt(16.0));
}

TEST(TurnedStudy, IsCoveredByItsSigma) {
  TurnedStudy study;
  study.on_the_spot = true;
  const StudyPlan plan = plan_with(study, 2, 12);
  const StudyTally tally = BlockWorker(plan).run({0, 12});
  EXPECT_GE(tally.estimates, 11U);
  EXPECT_EQ(tally.good_beyond_5_sigma, 0U);
  EXPECT_LT(figures_of(tally, 0, false).median, 0.01);
  EXPECT_GE(figures_of(tally, 0, false).coverage[2], 0.9);
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
