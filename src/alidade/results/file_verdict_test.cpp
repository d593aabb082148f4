#include "alidade/results/file_verdict.h"

#include <gtest/gtest.h>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

Verdict verdict_of(State state) {
  Verdict verdict;
  verdict.state = state;
  verdict.sentence = "Usable with care: \"zoom\" of 3 % \\ or another lens";
  return verdict;
}

TEST(FileVerdict, StandsInTheFileOfAnAnswerThatIsNotGoodAndComesBack) {
  EXPECT_EQ(file_verdict_text(verdict_of(State::good)), "");
  EXPECT_FALSE(file_verdict("model: brown\n"));
  EXPECT_FALSE(file_verdict("model: [\nverdict: care\n")) << "no YAML";
  for (const State state : {State::care, State::bad}) {
    const auto told = file_verdict("model: brown\n" + file_verdict_text(verdict_of(state)));
    ASSERT_TRUE(told);
    EXPECT_EQ(told->state, state);
    EXPECT_EQ(told->sentence, verdict_of(state).sentence);
  }
}

TEST(FileVerdict, CamerasAndBeamsAreReadWithIt) {
  const testing::TemporaryFolder folder;
  const std::string note = file_verdict_text(verdict_of(State::bad));
  Camera camera{640, 480, Calibrated<Brown>{}, {}, 0.0, ""};
  camera.lens = with_params(camera.lens, Eigen::VectorXd::Constant(params(camera.lens).size(), 0.5));
  write_file(folder.path() / "camera.yaml", camera_text(camera, CameraFormat::alidade) + note);
  EXPECT_EQ(read_camera(folder.path() / "camera.yaml").width_px, 640);
  Beam beam;
  beam.direction_in_cam = Eigen::Vector3d::UnitZ();
  write_file(folder.path() / "rangefinder.yaml", beam_text(beam, camera, "") + note);
  EXPECT_EQ(read_beam(folder.path() / "rangefinder.yaml").beam.direction_in_cam.z(), 1.0);
}

TEST(FileVerdict, OfAWrongInputNoAnswerIsGoodAndOnePassedOnIsNoBetter) {
  const auto state_after = [](State told, bool is_passed_on) {
    Verdict verdict;
    verdict.sentence = "Good: fx 500 ± 1 px";
    heed_file("camera.yaml", {told, "why"}, is_passed_on, verdict);
    EXPECT_NE(verdict.checks.at(0).text.find("camera.yaml"), std::string::npos);
    return verdict.state;
  };
  EXPECT_EQ(state_after(State::bad, false), State::care);
  EXPECT_EQ(state_after(State::care, false), State::good) << "its σ counts, and the check says so";
  EXPECT_EQ(state_after(State::care, true), State::care);
}

}  // namespace
}  // namespace alidade
