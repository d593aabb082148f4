#include <gtest/gtest.h>

#include <functional>
#include <numbers>
#include <string>
#include <string_view>

#include "alidade/geometry/degree.h"
#include "alidade/testing/track_sample.h"
#include "alidade/track/checks/explanation.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

using Undone = std::function<void(TargetObservation&)>;

Undone angles(double factor) {
  return [factor](TargetObservation& row) { row.pan_tilt_rad *= factor; };
}

Undone pixels(double factor) {
  return [factor](TargetObservation& row) { row.px = ((row.px.array() + 0.5) * factor - 0.5).matrix(); };
}

Verdict judged(const TrackScene& scene, const Undone& change, std::optional<std::size_t> head) {
  std::vector<TargetObservation> observations = testing::observations_of(scene, 1);
  for (TargetObservation& row : observations)
    if (!head || row.head == *head) change(row);
  const FollowConfig config;
  return track_verdict(track_target(observations, scene.heads, config), observations, scene.heads, config);
}

struct MisreadCase {
  Undone change;
  std::optional<std::size_t> head;
  std::string named;
};

TEST(MisreadUnits, AreNamedOfAllHeadsAndOfOne) {
  const auto tilt = [](TargetObservation& row) { row.pan_tilt_rad.y() *= 2.0; };
  const std::vector<MisreadCase> cases{{angles(1.0 / degree), std::nullopt, "angles in degrees"},
                                       {angles(1.0 / degree), 1, "angles of head 2 in degrees"},
                                       {angles(0.5), std::nullopt, "angles half of what the axes turn by"},
                                       {angles(2.0), 0, "angles of head 1 twice what the axes turn by"},
                                       {tilt, std::nullopt, "tilt angles twice"},
                                       {pixels(0.5), std::nullopt, "pixels of images of "},
                                       {pixels(0.5), 1, "pixels of head 2 of images of "},
                                       {pixels(2.0), std::nullopt, "pixels of images of "}};
  for (const char* scenario : {"B", "G"}) {
    for (const MisreadCase& of : cases) {
      const Verdict verdict = judged(*track_scenario(scenario), of.change, of.head);
      // The heads of G stand so near to zero that other faults of all heads do nearly the same.
      const bool is_told_apart = std::string_view(scenario) == "B";
      EXPECT_GE(verdict.state, is_told_apart ? State::bad : State::care) << scenario << " " << verdict.sentence;
      if (is_told_apart)
        EXPECT_NE(verdict.sentence.find(of.named), std::string::npos) << of.named << ": " << verdict.sentence;
      EXPECT_EQ(verdict.sentence.find("two targets"), std::string::npos) << scenario << ": " << verdict.sentence;
    }
  }
}

/// One table of pixels for two heads.
TEST(MisreadUnits, PixelsOfAnotherHeadAreNamed) {
  const TrackScene scene = *track_scenario("B");
  std::vector<TargetObservation> observations = testing::observations_of(scene, 1);
  const FollowConfig config;
  EXPECT_FALSE(copied_pixels(observations, scene.heads));
  Eigen::Vector2d px = observations.front().px;
  for (TargetObservation& row : observations) {
    if (row.head == 0) px = row.px;
    row.px = px;
  }
  const Verdict verdict =
      track_verdict(track_target(observations, scene.heads, config), observations, scene.heads, config);
  EXPECT_EQ(verdict.sentence, "the pixels of head 2 are those of head 1, digit for digit");
  EXPECT_EQ(verdict.exit_code, ExitCode::undetermined);
}

/// Whole turns that were taken off readings in degrees, as of an encoder that begins again, are put back.
TEST(MisreadUnits, OfReadingsThatLostATurn) {
  const TrackScene scene = *track_scenario("B");
  std::vector<TargetObservation> observations = testing::observations_of(scene, 1);
  for (TargetObservation& row : observations) {
    row.pan_tilt_rad /= degree;
    row.turns.x() = 1.0;
    row.pan_tilt_rad.x() -= 2.0 * std::numbers::pi;
  }
  const FollowConfig config;
  const Verdict verdict =
      track_verdict(track_target(observations, scene.heads, config), observations, scene.heads, config);
  EXPECT_NE(verdict.sentence.find("angles in degrees"), std::string::npos) << verdict.sentence;
}

}  // namespace
}  // namespace alidade
