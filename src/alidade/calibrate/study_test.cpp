#include "alidade/calibrate/study.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using testing::sample_board;
using testing::sample_camera;
using testing::sample_scene;
using testing::sample_size;
using testing::sample_views;

CalibrationStudy study_of(const std::vector<BoardView>& views) {
  const CalibrateConfig config;
  const auto report = calibrate(sample_board, views, sample_size, config);
  EXPECT_EQ(report.status, CalibrateReport::Status::converged);
  const auto transfers = test_shape_transfer(sample_board, views, sample_size, config);
  return study_calibration(sample_board, views, config, report, max_informative(transfers, config.board_shape));
}

TEST(StudyCalibration, HalvesOfOneCameraAgree) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    const auto study = study_of(sample_views(sample_scene(sample_camera("brown"), 16, seed), seed));
    ASSERT_TRUE(study.halves);
    // The largest of nine: over 4σ once in 1800 runs.
    EXPECT_LT(study.halves->worst_z, 4.0) << study.halves->worst_name << ", seed " << seed;
    EXPECT_FALSE(study.halves->worst_name.empty());
  }
}

TEST(StudyCalibration, HalvesOfTwoCamerasDoNot) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    auto views = sample_views(sample_scene(sample_camera("brown"), 16, seed), seed);
    // Another camera of the same kind: 3.5 % longer, its principal point 11 px aside.
    const Camera other = sample_camera("brown", {{"fx", 530.0}, {"fy", 531.0}, {"cx", 335.0}});
    const auto others = sample_views(sample_scene(other, 16, seed + 10), seed + 10);
    for (std::size_t k = 1; k < views.size(); k += 2) views[k] = others[k];
    const auto study = study_of(views);
    ASSERT_TRUE(study.halves);
    EXPECT_GT(study.halves->worst_z, 6.0) << "seed " << seed;
  }
}

TEST(StudyCalibration, SaysWhatFewPhotosCannot) {
  const auto study = study_of(sample_views(sample_scene(sample_camera("brown"), 5, 1), 1));
  EXPECT_FALSE(study.halves);
  EXPECT_FALSE(study.transfer);
  EXPECT_TRUE(study.models.empty());
  EXPECT_FALSE(study.cells.empty());
  EXPECT_FALSE(study.sigma_infinity.values.empty());
}

TEST(StudyCalibration, WorkingDistanceIsTheBoards) {
  const BoardScene scene = sample_scene(sample_camera("brown"), 9, 2);
  const auto study = study_of(sample_views(scene, 2));
  std::vector<double> distances;
  for (const Rigid3& pose : scene.cam_from_board) distances.push_back(pose.translation.norm());
  std::sort(distances.begin(), distances.end());
  EXPECT_NEAR(study.working_distance_m, distances[4], 0.01 * distances[4]);  // far wider than the poses' σ
}

}  // namespace
}  // namespace alidade
