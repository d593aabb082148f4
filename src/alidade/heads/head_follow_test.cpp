#include "alidade/heads/head_follow.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"

// A target that goes to and fro before a head and a camera that are simulated, in a time of their own.

namespace alidade {
namespace {

RigHead true_rig(const SimulatedCamera& camera) {
  RigHead rig;
  rig.camera.width_px = camera.width_px;
  rig.camera.height_px = camera.height_px;
  Calibrated<Brown> lens;
  lens.params.head<6>() << camera.fx, camera.fy, camera.cx, camera.cy, 0.0, camera.k1;
  rig.camera.lens = lens;
  rig.head.cam_from_tilt = exp_so3(camera.mount_rad);
  return rig;
}

HeadFollowing followed(const std::string& head_words, const std::string& camera_words, const HeadFollowConfig& config) {
  const std::unique_ptr<HeadDevice> head = open_head("sim://?clock=free&" + head_words);
  const std::unique_ptr<FrameStream> stream = open_stream("sim://?" + camera_words, *head);
  const RigHead rig = true_rig(simulated_camera(camera_words, "test"));
  return follow_target(*head, *stream, rig, TargetLook{.kind = TargetKind::bright}, nullptr, config);
}

TEST(HeadFollow, KeepsAMovingTargetInTheMiddle) {
  const HeadFollowing result = followed("rate=40&latency=0.1", "fps=20&mount=1:-2:3&delay=0.04&target=10:0:3:30:1.2",
                                        {.most_s = 25.0, .latency_s = 0.1, .delay_s = -0.04});
  EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  EXPECT_GT(result.num_commands, 100u);
  EXPECT_LT(result.rms_px, 12.0);  // 2°; at rest it would be 9° off, and lost
  EXPECT_GT(result.central_third, 0.95);
}

TEST(HeadFollow, StandsWhereNothingLooksSo) {
  const HeadFollowing result = followed("rate=40", "fps=20&target=0:90:0:0:1.2", {.most_s = 6.0});
  EXPECT_EQ(result.verdict.exit_code, ExitCode::cannot_tell);
  EXPECT_EQ(result.num_commands, 0u);
}

}  // namespace
}  // namespace alidade
