#include "alidade/localize/frames/white_pixels.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/testing/hover.h"

namespace alidade {
namespace {

using testing::Hover;
using testing::hovering;
using testing::HoverLens;
using testing::HoverRun;

constexpr double default_px = 0.5;

Hover white_scene(HoverLens lens, double sigma_px) {
  return {.lens = lens, .num_frames = 150, .num_others = 40, .sigma_px = sigma_px};
}

TEST(WhitePixels, AreThoseOfTheNoise) {
  for (const HoverLens lens : {HoverLens::brown, HoverLens::fisheye, HoverLens::port})
    for (const double sigma_px : {0.1, 0.5, 2.0, 4.0}) {
      constexpr int draws = 8;
      double mean_px = 0.0;
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const HoverRun run = hovering(white_scene(lens, sigma_px), seed);
        const auto white = white_pixels(run.frames, run.camera);
        ASSERT_TRUE(white);
        mean_px += white->sigma_px / draws;
        EXPECT_LT(std::abs(white->sigma_px / sigma_px - 1.0), 4.0 * white->relative + 0.02) << sigma_px << " " << seed;
        EXPECT_LT(white->tails, 1.2);
        const auto other = other_sigma_px(run.frames, run.camera, default_px);
        EXPECT_EQ(other.has_value(), sigma_px != default_px) << sigma_px << " px, seed " << seed;
      }
      EXPECT_NEAR(mean_px, sigma_px, 0.05 * sigma_px);
    }
}

/// The rig's shortest table: four points, and nothing else.
TEST(WhitePixels, AreFoundOfFourPoints) {
  for (const double sigma_px : {0.5, 2.0}) {
    HoverRun run = hovering(white_scene(HoverLens::brown, sigma_px), 3);
    for (ObservationFrame& frame : run.frames)
      std::erase_if(frame.observations, [](const FeatureObservation& each) { return each.id > 4; });
    const auto white = white_pixels(run.frames, run.camera);
    ASSERT_TRUE(white);
    EXPECT_NEAR(white->sigma_px, sigma_px, 0.3 * sigma_px);
    EXPECT_EQ(other_sigma_px(run.frames, run.camera, default_px).has_value(), sigma_px > default_px);
  }
}

/// Another focal length, no distortion, a rolling shutter, a target that turns, and errors that last leave it as it is
/// or smaller; mismatches hardly raise it, or it says that it cannot tell.
TEST(WhitePixels, HoldNoFault) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Hover scene = white_scene(HoverLens::brown, default_px);
    HoverRun run = hovering(scene, seed);
    Camera other = run.camera;
    Eigen::VectorXd values = params(other.lens);
    values.head<2>() *= 1.1;
    values.tail<5>().setZero();
    other.lens = with_params(other.lens, values);
    EXPECT_FALSE(other_sigma_px(run.frames, other, default_px)) << seed;
    Hover rolls = scene, turns = scene, lasts = scene, mixed = scene, very_mixed = scene;
    rolls.readout_s = 0.02;
    EXPECT_FALSE(other_sigma_px(hovering(rolls, seed).frames, run.camera, default_px)) << seed;
    turns.target_turn_rad_s = {0.0, 0.2, 0.1};
    EXPECT_FALSE(other_sigma_px(hovering(turns, seed).frames, run.camera, default_px)) << seed;
    lasts.lasting = 0.9;
    const auto lasting = other_sigma_px(hovering(lasts, seed).frames, run.camera, default_px);
    ASSERT_TRUE(lasting);
    EXPECT_LT(*lasting, default_px);
    mixed.mismatches = 0.1;
    const auto among = other_sigma_px(hovering(mixed, seed).frames, run.camera, default_px);
    EXPECT_LT(among.value_or(default_px), 1.3 * default_px) << seed;
    very_mixed.mismatches = 0.4;
    EXPECT_FALSE(other_sigma_px(hovering(very_mixed, seed).frames, run.camera, default_px)) << seed;
  }
}

TEST(WhitePixels, OfFewFramesUnevenTimesOrStatedSigmaAreNone) {
  const HoverRun run = hovering(white_scene(HoverLens::brown, 2.0), 1);
  const std::span<const ObservationFrame> frames = run.frames;
  EXPECT_TRUE(white_pixels(frames.first(12), run.camera));
  EXPECT_FALSE(white_pixels(frames.first(3), run.camera));
  EXPECT_FALSE(white_pixels({}, run.camera));
  std::vector<ObservationFrame> stated = run.frames, uneven = run.frames, few = run.frames;
  for (ObservationFrame& frame : stated)
    for (FeatureObservation& each : frame.observations) each.sigma_px = 1.0;
  EXPECT_FALSE(white_pixels(stated, run.camera));
  for (std::size_t k = 0; k < uneven.size(); ++k) uneven[k].t_s += 0.3 * static_cast<double>(k / 2);
  EXPECT_FALSE(white_pixels(uneven, run.camera));
  for (ObservationFrame& frame : few) frame.observations.resize(3);
  EXPECT_FALSE(white_pixels(few, run.camera));
}

/// What a camera that goes far from frame to frame leaves in differences is not taken for noise, or hardly.
TEST(WhitePixels, OfFramesFarApartRaiseHardlyAnything) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed)
    for (const double dt_s : {0.2, 0.35, 0.5, 1.0, 2.0}) {
      Hover scene = white_scene(HoverLens::brown, default_px);
      scene.dt_s = dt_s;
      const HoverRun run = hovering(scene, seed);
      EXPECT_LT(other_sigma_px(run.frames, run.camera, default_px).value_or(default_px), 1.3 * default_px)
          << dt_s << " s, seed " << seed;
    }
}

}  // namespace
}  // namespace alidade
