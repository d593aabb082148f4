#include "alidade/localize/known_pose.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

Camera plain_camera() {
  Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  Params<Brown> values = Params<Brown>::Zero();
  values.head<4>() << 600.0, 600.0, 319.5, 239.5;
  camera.lens = Calibrated<Brown>{values};
  return camera;
}

struct InView {
  std::vector<KnownPoint> known;
  std::vector<FeatureObservation> observations;
  Rigid3 world_from_cam;
};

/// Points in a box two metres ahead of a camera that stands anywhere, as seen with half a pixel of noise.
InView drawn_view(Draws& draws, std::size_t num) {
  const auto vector = [&](double size) {
    const double x = draws.uniform(-size, size), y = draws.uniform(-size, size), z = draws.uniform(-size, size);
    return Eigen::Vector3d(x, y, z);
  };
  InView view;
  view.world_from_cam = {exp_so3(vector(1.5)), vector(3.0)};
  const Camera camera = plain_camera();
  for (std::size_t i = 0; i < num; ++i) {
    const Eigen::Vector3d in_cam = vector(0.5) + Eigen::Vector3d(0.0, 0.0, 2.0);
    view.known.push_back({static_cast<long>(i), view.world_from_cam * in_cam, 1e-4});
    view.observations.push_back({static_cast<long>(i), *project(camera, in_cam) + 0.5 * draws.normal2(), 0.0});
  }
  return view;
}

double nees(const StartHypothesis& start, const Rigid3& truth) {
  Eigen::Vector<double, 6> error;
  const Rigid3& is = start.motion.world_from_cam;
  error << truth.translation - is.translation, log_so3(is.rotation.conjugate() * truth.rotation);
  return error.dot(start.cov.topLeftCorner<6, 6>().inverse() * error) / 6.0;
}

/// Points that are in no plane: the pose of maximum likelihood, its σ what the errors are.
TEST(KnownPose, PointsInSpaceGiveThePoseAndItsCovariance) {
  Draws draws(3);
  constexpr int num_draws = 200;
  double sum = 0.0;
  for (int i = 0; i < num_draws; ++i) {
    const InView view = drawn_view(draws, 10);
    const auto starts = poses_from_known(plain_camera(), view.observations, view.known);
    ASSERT_FALSE(starts.empty()) << i;
    sum += nees(starts.front(), view.world_from_cam);
  }
  EXPECT_NEAR(sum / num_draws, 1.0, 0.15);  // χ² of 1200 numbers: σ .04; and curvature
}

/// Four of ten moved by up to 20 px: those that agree say where the camera is.
TEST(KnownPose, OfPointsInSpaceMismatchesAreRejected) {
  Draws draws(5);
  constexpr int num_draws = 100;
  for (int i = 0; i < num_draws; ++i) {
    InView view = drawn_view(draws, 15);
    for (std::size_t k = 0; k < 6; ++k) {
      Eigen::Vector2d off = Eigen::Vector2d::Zero();
      while (off.norm() < 5.0) {  // nearer ones are noise, and none can tell them
        const double u = draws.uniform(-20.0, 20.0), v = draws.uniform(-20.0, 20.0);
        off = {u, v};
      }
      view.observations[k].px += off;
    }
    const auto starts = poses_from_known(plain_camera(), view.observations, view.known);
    ASSERT_FALSE(starts.empty()) << i;
    EXPECT_LT(nees(starts.front(), view.world_from_cam), 8.0) << i;  // of six numbers, in a hundred draws
  }
}

/// Observations of other points than they are said to be fit no pose.
TEST(KnownPose, PointsInSpaceThatAreSomewhereElseFitNone) {
  Draws draws(9);
  for (int i = 0; i < 50; ++i) {
    InView view = drawn_view(draws, 12);
    const InView other = drawn_view(draws, 12);
    for (std::size_t k = 0; k < view.known.size(); ++k) view.observations[k].px = other.observations[k].px;
    EXPECT_TRUE(poses_from_known(plain_camera(), view.observations, view.known).empty()) << i;
  }
}

}  // namespace
}  // namespace alidade
