#include "alidade/calibrate/checks/heldout.h"

#include <gtest/gtest.h>

#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using testing::sample_board;
using testing::sample_camera;
using testing::sample_scene;
using testing::sample_size;
using testing::sample_views;

const CalibrateConfig without_k3{.fixed = {"skew", "k3"}};

std::vector<HeldOutModel> models_of(const Camera& camera, const CalibrateConfig& config, std::uint64_t seed) {
  const auto views = sample_views(sample_scene(camera, 15, seed), seed);
  return heldout_models(sample_board, views, sample_size, config, points_in_board(sample_board), {});
}

const HeldOutModel& named(const std::vector<HeldOutModel>& models, const std::string& name) {
  for (const HeldOutModel& model : models) {
    if (model.name == name) return model;
  }
  throw std::logic_error(name);
}

TEST(HeldOutModels, NoRicherModelGainsWhereTheLensIsRight) {
  int richer = 0, gains = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    for (const HeldOutModel& model : models_of(sample_camera("brown", {{"k3", 0.0}}), without_k3, seed)) {
      if (!model.is_richer) continue;
      ++richer;
      const bool gains_much = model.gain_px > 2.0 * model.sigma_px;
      gains += gains_much;
      if (gains_much) RecordProperty("gains_seed_" + std::to_string(seed), model.name);
    }
  }
  EXPECT_EQ(richer, 12 * 3);
  EXPECT_EQ(gains, 0);
}

TEST(HeldOutModels, PlainerModelsLoseWhatTheyLack) {
  const auto models = models_of(sample_camera("brown", {{"k3", 0.0}}), without_k3, 1);
  const HeldOutModel& model = named(models, "k1");
  EXPECT_FALSE(model.is_richer);
  EXPECT_LT(model.gain_px, -2.0 * model.sigma_px);
}

TEST(HeldOutModels, ARicherModelGainsWhereTheLensNeedsIt) {
  const auto models = models_of(sample_camera("brown"), {.fixed = {"skew", "k2", "p1", "p2", "k3"}}, 1);
  const HeldOutModel& full = named(models, "k1 k2 p1 p2 k3");
  EXPECT_TRUE(full.is_richer);
  EXPECT_GT(full.gain_px, 2.0 * full.sigma_px);
}

TEST(HeldOutModels, AModelOffTheLadderStandsInFront) {
  const auto models = models_of(sample_camera("brown"), {.fixed = {"skew", "p1", "k2"}}, 1);
  EXPECT_EQ(models.front().name, "brown (as asked)");
  EXPECT_EQ(models.front().gain_px, 0.0);
  EXPECT_EQ(models.front().sigma_px, 0.0);
  EXPECT_EQ(models.size(), 7u);
}

TEST(HeldOutModels, TheErrorIsThatOfTheNoise) {
  const auto models = models_of(sample_camera("brown", {{"k3", 0.0}}), without_k3, 4);
  // 108 coordinates less 6 of the pose, the best nineteen in twenty: χ²(2) cut at its 95 % keeps 0.842 of its mean.
  const double expected = 0.1 * std::sqrt(2.0 * 102.0 / 108.0 * 0.842);
  // Scatter of √(Σ of 15 · 51 squares): 1.8 %, three of it; the lens, known from the other photos, adds under 2 %.
  EXPECT_NEAR(named(models, "k1 k2 p1 p2").heldout_rms_px, expected, (3 * 0.018 + 0.02) * expected);
}

}  // namespace
}  // namespace alidade
